"""Brushes: the settings of the atomizer that a paint programme chooses by number."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from paint_deposition.errors import ModelError
from paint_deposition.model.eq1_pattern import PlanarPattern

# Messages carry the number in 32 bits.
MOST = 2**31 - 1
# Numbers from here on stand for set-points between brushes; nobody else can name them. So many at
# the most: set-points that change all the time are measured ones.
BETWEEN, MOST_BETWEEN = MOST + 1, 200


class SetPoints(BaseModel):
    """What the cell sets for a brush; None is not known."""

    model_config = ConfigDict(frozen=True, extra='forbid', allow_inf_nan=False)

    flow_cm3_per_min: float | None = Field(
        None, gt=0.0, le=10_000.0, description='wet paint at relative flow 1 [cm3/min]'
    )
    shaping_air_l_per_min: float | None = Field(
        None, gt=0.0, le=10_000.0, description='shaping air at standard conditions [l/min]'
    )
    bell_speed_rpm: float | None = Field(
        None, gt=0.0, le=200_000.0, description='speed of the bell cup [rev/min]'
    )
    voltage_kv: float | None = Field(
        None, gt=0.0, le=200.0, description='high voltage, its magnitude [kV]'
    )
    solids: float | None = Field(
        None, gt=0.0, le=1.0, description='share of solids in the volume of the wet paint [1]'
    )
    density_g_per_cm3: float | None = Field(
        None, gt=0.0, le=20.0, description='of the wet paint [g/cm3]'
    )


class Brush(SetPoints):
    """The pattern of eq. (1) at one setting of the atomizer.

    Attributes:
        number: by which programmes choose it, 1 to MOST; from BETWEEN on it stands for set-points.
        planar: its pattern.
        interpolated: whether the pattern follows from those of the other brushes, see
            ``brush_law``.
    """

    number: int = Field(ge=1, lt=BETWEEN + MOST_BETWEEN)
    planar: PlanarPattern
    interpolated: bool = False

    @property
    def calibrated(self) -> 'Brush':
        """The same as one that the others do not determine."""
        return self.model_copy(update={'interpolated': False})

    @property
    def set_points(self) -> SetPoints:
        """What the cell sets for it."""
        return SetPoints(**{name: getattr(self, name) for name in SetPoints.model_fields})


def listed(numbers: Iterable[int]) -> str:
    """Numbers of brushes in words, without those that stand for set-points."""
    return ', '.join(str(number) for number in sorted(numbers) if number < BETWEEN)


SETTINGS = ('flow_cm3_per_min', 'shaping_air_l_per_min', 'bell_speed_rpm', 'voltage_kv')


@dataclass(frozen=True)
class Exponents:
    """Prior of the exponents of one quantity, in the order of SETTINGS: means and deviation."""

    mean: tuple[float, float, float, float]
    deviation: float


WIDTH = Exponents((0.0, -1.0, 1.0, -1.0), 0.5)
EFFICIENCY = Exponents((0.0, 0.0, 0.0, 0.0), 0.3)
FORM = Exponents((0.0, 0.0, 0.0, 0.0), 0.3)
# Standard deviations: of the law at a calibrated brush, and of the prior of a level.
MET, LEVEL = 1e-4, 10.0


@dataclass(frozen=True)
class BrushLaw:
    """The law through calibrated brushes, two at least."""

    brushes: tuple[Brush, ...]

    def pattern(self, where: str, wanted: SetPoints) -> PlanarPattern:
        """The pattern at these set-points.

        Raises:
            ModelError: one line that begins with ``where``, if a set-point is missing or out of
                the calibrated range.
        """
        if len(self.brushes) < 2:
            raise ModelError(
                f'{where} has no planar and lies between no two brushes that have one; give planar'
            )
        settings = self._settings(where, wanted)
        at = np.array([np.log(getattr(wanted, name)) for name in settings])
        size, transfer, *form = self._at(at, settings)
        w, (r, sigma1, sigma2, k2, k3_cos, k3_sin) = np.exp(size), form
        values = {
            'K1_cm3_per_s': np.exp(transfer) * self._sprayed(wanted),
            'K2': k2, 'K3': np.hypot(k3_cos, k3_sin), 'phi_rad': np.arctan2(k3_sin, k3_cos),
            'r_m': w * r, 'sigma1_m': w * sigma1, 'sigma2_m': w * sigma2,
        }  # fmt: skip
        try:
            return PlanarPattern(**{name: float(value) for name, value in values.items()})
        except ValueError:
            raise ModelError(
                f'{where}: the law of the brushes gives no pattern there; calibrate it'
            ) from None

    def exponents(self) -> dict[str, dict[str, tuple[float, float]]]:
        """Fitted exponents of width and transfer efficiency: value and deviation by set-point."""
        settings = [name for name in SETTINGS if self._known(name)]
        x, y = self._table(settings)
        away = x - x[0]
        found = {}
        for row, (name, prior) in enumerate((('width', WIDTH), ('efficiency', EFFICIENCY))):
            mean = _of(prior.mean, settings)
            gain = prior.deviation**2 * away.T @ np.linalg.inv(_covariance(x, x, prior, True))
            value = mean + gain @ (y[:, row] - x @ mean)
            variance = prior.deviation**2 * (np.eye(len(settings)) - gain @ away)
            deviation = np.sqrt(np.maximum(np.diag(variance), 0.0))
            pairs = zip(settings, value.tolist(), deviation.tolist(), strict=True)
            found[name] = {setting: (v, d) for setting, v, d in pairs}
        return found

    def _settings(self, where: str, wanted: SetPoints) -> list[str]:
        """The set-points that the law takes there."""
        numbers = listed(brush.number for brush in self.brushes)
        for name in (*SETTINGS, 'solids'):
            value = getattr(wanted, name)
            known = [getattr(brush, name) for brush in self.brushes]
            given = [each for each in known if each is not None]
            if value is None and len(set(given)) > 1:
                raise ModelError(
                    f'{where}: {name} is missing, in which brushes {numbers} differ; give it'
                )
            if value is None or (name == 'solids' and not given):
                continue
            if len(given) < len(known):
                lacks = next(b.number for b in self.brushes if getattr(b, name) is None)
                raise ModelError(f'{where}: {name} is given and brush {lacks} has none; add it')
            if name in SETTINGS and not min(given) <= value <= max(given):
                raise ModelError(
                    f'{where}: {name} is {value:g}, outside {min(given):g} to {max(given):g} of '
                    f'the calibrated brushes {numbers}; calibrate a brush there'
                )
        return [name for name in SETTINGS if getattr(wanted, name) is not None]

    def _known(self, name: str) -> bool:
        return all(getattr(brush, name) is not None for brush in self.brushes)

    def _sprayed(self, at: SetPoints) -> float:
        """The solids or paint sprayed [cm3/s], to which the transfer efficiency refers; else 1."""
        first, share = self.brushes[0], 1.0
        for name, unit in (('flow_cm3_per_min', 60.0), ('solids', 1.0)):
            if self._known(name):
                own = getattr(at, name)
                share *= (getattr(first, name) if own is None else own) / unit
        return share

    def _table(self, settings: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
        """Logarithms of the set-points (B, s), and of the brushes (B, 8) what the laws are of."""
        x = np.array([[np.log(getattr(b, name)) for name in settings] for b in self.brushes])
        rows = []
        for brush in self.brushes:
            p, w = brush.planar, _size_m(brush.planar)
            transfer = p.K1_cm3_per_s / self._sprayed(brush)
            rows.append([
                np.log(w), np.log(transfer), p.r_m / w, p.sigma1_m / w, p.sigma2_m / w, p.K2,
                p.K3 * np.cos(p.phi_rad), p.K3 * np.sin(p.phi_rad),
            ])  # fmt: skip
        return x.reshape(len(self.brushes), len(settings)), np.array(rows)

    def _at(self, at: np.ndarray, settings: Sequence[str]) -> np.ndarray:
        """(8,) the same at logarithms (s,) of set-points: a linear regression with priors."""
        x, y = self._table(settings)
        found = []
        for row, values in enumerate(y.T):
            prior = (WIDTH, EFFICIENCY)[row] if row < 2 else FORM
            mean = _of(prior.mean, settings)
            weights = np.linalg.solve(_covariance(x, x, prior, noise=True), values - x @ mean)
            found.append(at @ mean + _covariance(at[np.newaxis], x, prior)[0] @ weights)
        return np.array(found)


def _of(values: Sequence[float], settings: Sequence[str]) -> np.ndarray:
    """(s,) those of these settings."""
    return np.array([values[SETTINGS.index(name)] for name in settings])


def _covariance(
    x: np.ndarray, others: np.ndarray, prior: Exponents, noise: bool = False
) -> np.ndarray:
    """(n, m) prior covariance of a quantity at set-points (n, s) and (m, s)."""
    # About the first brush, so that the level and the exponents do not mix.
    origin = others[0]
    shared = LEVEL**2 + prior.deviation**2 * (x - origin) @ (others - origin).T
    return shared + MET**2 * np.eye(len(x)) if noise else shared


def _size_m(planar: PlanarPattern) -> float:
    """Size of a pattern [m]: about the root mean square distance of the paint from the axis."""
    ring = planar.r_m**2 + 2.0 * planar.sigma1_m**2
    return float(np.sqrt((1.0 - planar.K2) * ring + planar.K2 * 2.0 * planar.sigma2_m**2))
