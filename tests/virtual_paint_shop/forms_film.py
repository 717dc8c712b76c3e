"""Other laws of fog, of running film and of the gauge: alike in kind, not in form."""

from __future__ import annotations

import numpy as np

from .truths import KAPPA_REF_PER_M
from .truths_film import (
    FogGradient,
    GaugeCurvatureBias,
    OversprayFog,
    Sag,
    run_down,
)


class SagYield(Sag):
    """Paint with a yield stress: only film above 8 um runs, and then like a thinner one."""

    form = 'yield'

    def run_down(self, film_um, dz_m):
        return run_down(film_um, dz_m, self.amplitude, yield_um=8.0)


class SagShearThinning(Sag):
    """A power-law fluid of index 0.6: flux ~ T^(2 + 1 / 0.6)."""

    form = 'shear_thinning'

    def run_down(self, film_um, dz_m):
        return run_down(film_um, dz_m, self.amplitude, power=2.0 + 1.0 / 0.6)


class FogThinsOut(OversprayFog):
    """A cloud over the part's middle that thins out towards its sides by a third."""

    form = 'thins_out'

    def on_film(self, film_um, x, z, scene, film_at):
        side = np.abs(x) / (0.5 * scene.part.width_m)
        return film_um + self.amplitude * (1.0 - 0.35 * side**2)


class FogExponential(FogGradient):
    """Fog that is used up on its way down from the exhaust's eddy: e-fold over a third."""

    form = 'exponential'

    def on_film(self, film_um, x, z, scene, film_at):
        share = np.clip(z / scene.part.height_m, 0.0, 1.0)
        return film_um + self.amplitude * np.exp(-3.0 * share)


class FogLayer(FogGradient):
    """A layer of fog over the floor that reaches up to some height of the part."""

    form = 'layer'

    @classmethod
    def details(cls, rng):
        return {'top': rng.uniform(0.25, 0.6)}

    def on_film(self, film_um, x, z, scene, film_at):
        share = np.clip(z / scene.part.height_m, 0.0, 1.0)
        return film_um + self.amplitude / (1.0 + np.exp((share - self.drawn['top']) / 0.07))


class GaugeBiasLinear(GaugeCurvatureBias):
    """The air gap under a probe of 12 mm grows in proportion to the curvature."""

    form = 'linear'

    def on_gauge(self, film_um, x, z, scene):
        low, high = scene.part.curvature_over(x, z, 0.012)
        return film_um - self.amplitude * (low + high) / KAPPA_REF_PER_M


class GaugeBiasRidge(GaugeCurvatureBias):
    """A probe with a guide foot: reads high on ridges, saturating, and little low in hollows."""

    form = 'ridge'

    def on_gauge(self, film_um, x, z, scene):
        low, high = scene.part.curvature_over(x, z, 0.008)
        k = (low + high) / KAPPA_REF_PER_M
        return film_um + self.amplitude * np.where(k < 0, -k / (1.0 - 0.3 * k), -0.3 * k)
