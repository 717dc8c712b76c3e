"""Hidden effects after landing: fog that settles, wet film that runs, and what the gauge says."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import RectBivariateSpline

from .truths import KAPPA_REF_PER_M, Truth, between, variant

SAG_REFERENCE_UM = 20.0


class Sag(Truth):
    """Wet film runs down: flux ~ T^3 (upwind, bottom drains), um m across a line of 20 um."""

    id, family, typical, most, unit = 'sag', 'lateral shift', 0.06, 0.5, 'um m'
    power, yield_um = 3.0, 0.0

    def on_film(self, film_um, x, z, scene, film_at):
        part = scene.part
        xs = np.linspace(-0.5 * part.width_m, 0.5 * part.width_m, 22)
        zs = np.linspace(-0.02, part.height_m + 0.02, 36)
        gx, gz = np.meshgrid(xs, zs, indexing='ij')
        coarse = film_at(gx.ravel(), gz.ravel()).reshape(gx.shape)
        fine_z = np.linspace(0.0, part.height_m, 361)
        before = np.maximum(RectBivariateSpline(xs, zs, coarse)(xs, fine_z), 0.0)
        after = self.run_down(before, fine_z[1] - fine_z[0])
        change = RectBivariateSpline(xs, fine_z, after - before, kx=3, ky=1)
        return film_um + change.ev(x, z)

    def run_down(self, film_um: np.ndarray, dz_m: float) -> np.ndarray:
        """Film (columns, heights bottom to top) after running: its flux ~ (T - yield)^power."""
        power, yield_um = self.power, self.yield_um
        total = self.amplitude / (SAG_REFERENCE_UM - yield_um) ** power
        moving = np.maximum(film_um - yield_um, 0.0)
        fastest = power * total * moving.max() ** (power - 1.0)
        steps = int(np.ceil(2.0 * fastest / dz_m)) + 8
        for weight in np.full(steps, 1.0 / steps):
            crossing = total * weight * np.maximum(film_um - yield_um, 0.0) ** power
            arriving = np.concatenate([crossing[:, 1:], np.zeros((len(film_um), 1))], axis=1)
            film_um = film_um + (arriving - crossing) / dz_m
        return film_um


variant(Sag, 'yield', 'A yield stress: only film above 8 um runs.', yield_um=8.0)
variant(Sag, 'shear_thinning', 'A power-law fluid of index 0.6.', power=2.0 + 1.0 / 0.6)


class OversprayFog(Truth):
    """Fine overspray settles everywhere alike."""

    id, family, typical, most, unit = 'overspray_fog', 'level', 1.0, 6.0, 'um'

    def on_film(self, film_um, x, z, scene, film_at):
        return film_um + self.amplitude * self.settled(x / (0.5 * scene.part.width_m))

    def settled(self, aside: np.ndarray) -> np.ndarray:
        return 1.0


variant(OversprayFog, 'thins_out', "A cloud over the part's middle, less by a third at the sides.",
        settled=lambda self, aside: 1.0 - 0.35 * np.abs(aside) ** 2)  # fmt: skip


class FogGradient(Truth):
    """Overspray that settles more below: a (1 - height share)^1.5."""

    id, family, typical, most, unit = 'fog_gradient', 'order', 1.5, 10.0, 'um'

    def on_film(self, film_um, x, z, scene, film_at):
        share = np.clip(z / scene.part.height_m, 0.0, 1.0)
        return film_um + self.amplitude * self.settled(share)

    def settled(self, share: np.ndarray) -> np.ndarray:
        return (1.0 - share) ** 1.5


variant(FogGradient, 'exponential', 'Fog that is used up on its way: e-fold over a third.',
        settled=lambda self, share: np.exp(-3.0 * share))  # fmt: skip
variant(FogGradient, 'layer', 'Fog over the floor that reaches up to some height of the part.',
        ranges=between(top=(0.25, 0.6)),
        settled=lambda self, share: 1.0 / (1.0 + np.exp((share - self.drawn['top']) / 0.07)),
        )  # fmt: skip


class GaugeGain(Truth):
    """The gauge reads (1 + a) times the film."""

    id, family, typical, most, unit, sign = 'gauge_gain', 'level', 0.02, 0.15, '1', 'either'

    def on_gauge(self, film_um, x, z, scene):
        return (1.0 + self.amplitude) * film_um


class GaugeZero(Truth):
    """The gauge reads `amplitude` too much."""

    id, family, typical, most, unit, sign = 'gauge_zero', 'level', 1.2, 5.0, 'um', 'either'

    def on_gauge(self, film_um, x, z, scene):
        return film_um + self.amplitude


class GaugeCurvatureBias(Truth):
    """Reads high where convex: 2a tanh(k / 2), k = -(sum of curvatures over 5 mm) x 250 mm."""

    id, family, typical, unit = 'gauge_curvature_bias', 'curvature', 1.2, 'um'
    most, probe_m = 6.0, 0.005

    def on_gauge(self, film_um, x, z, scene):
        low, high = scene.part.curvature_over(x, z, self.probe_m)
        return film_um + self.amplitude * self.too_much((low + high) / KAPPA_REF_PER_M)

    @staticmethod
    def too_much(k: np.ndarray) -> np.ndarray:
        return -2.0 * np.tanh(0.5 * k)


variant(GaugeCurvatureBias, 'linear', 'The air gap under a probe of 12 mm: the curvature itself.',
        probe_m=0.012, too_much=lambda k: -k)  # fmt: skip
variant(GaugeCurvatureBias, 'ridge', 'A guide foot: high on ridges.', probe_m=0.008,
        too_much=lambda k: np.where(k < 0, -k / (1.0 - 0.3 * k), -0.3 * k))  # fmt: skip
