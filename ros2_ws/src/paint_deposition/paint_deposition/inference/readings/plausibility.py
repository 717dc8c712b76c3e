"""Plausibility of readings and of the paint below them, checked before anything is fitted."""

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ModelError, ReadingsError, some
from paint_deposition.film.integrator import NO_PAINT_UM, FilmIntegrator
from paint_deposition.film.spray_geometry import SprayGeometry, spray_geometry
from paint_deposition.inference.readings.campaign import Campaign, Experiment
from paint_deposition.inference.readings.places import unit_in_doubt
from paint_deposition.inference.readings.readings import Readings
from paint_deposition.part.surface import Surface
from paint_deposition.part.zones import NONE

# The pattern has seven parameters, and a fit needs a few points more.
FEWEST_POINTS = 10
UNITS = {'mil': 25.4, 'mm': 1000.0}  # um in each
# No paint film is thinner than this everywhere; such numbers are mils or millimetres.
THINNEST_FILM_UM = 3.0
# Two units in one column leave a gap: sorted by size, neighbours differ by more than this factor.
LEAST_GAP = 6.0
UNIT_SLACK = 1.8


def check_unit(readings: Readings) -> None:
    """Refuse readings in another unit."""
    highest = float(readings.thickness_um.max())
    if highest < THINNEST_FILM_UM:
        unit = 'mil' if highest > 0.15 else 'mm'
        raise ReadingsError(
            f"{readings.source}: '{readings.heading}' is at most {highest:g} µm; these look like "
            f'{unit}, say unit: {{thickness: {unit}}} in the campaign'
        )


def check_readings(readings: Readings, sigma_um: np.ndarray) -> None:
    """Refuse readings that no film gives.

    Args:
        sigma_um: (N,) standard deviation of a reading [um].
    """
    film = readings.thickness_um
    below = film < -4.0 * sigma_um
    if below.any():
        worst = int(np.argmin(film))
        raise ReadingsError(
            f"{readings.source}: point '{readings.point[worst]}' reads {film[worst]:g} µm; film "
            'is not negative, zero the gauge on bare metal'
        )
    film = np.sort(film[film > 0.0])
    if len(film) < 2:
        return
    ratio = film[1:] / film[:-1]
    cut = int(np.argmax(ratio))
    low, high = film[: cut + 1], film[cut + 1 :]
    # Readings beside the pattern are small, too, but they differ among themselves.
    apart = ratio[cut] >= LEAST_GAP and low.max() <= LEAST_GAP * low.min()
    if not apart or np.median(high) < THINNEST_FILM_UM:
        return
    factor = float(np.median(high) / np.median(low))
    for unit, exact in UNITS.items():
        if exact / UNIT_SLACK < factor < exact * UNIT_SLACK:
            raise _other_unit(readings, low, high, unit)


def check_units_against_fit(
    readings: Readings, measured_um: np.ndarray, expected_um: np.ndarray
) -> None:
    """Refuse points that agree with a robust fit if they are taken for another unit.

    Args:
        measured_um, expected_um: (P,) point means, and the film expected there [um].
    """
    thick = (expected_um > THINNEST_FILM_UM) & (measured_um > 0.0)
    ratio = np.where(thick, expected_um, 1.0) / np.where(thick, measured_um, 1.0)
    for unit, exact in UNITS.items():
        strange = (ratio > exact / UNIT_SLACK) & (ratio < exact * UNIT_SLACK)
        if strange.any():
            raise _other_unit(readings, measured_um[strange], expected_um[strange], unit)


def _other_unit(
    readings: Readings, strange: np.ndarray, others_um: np.ndarray, unit: str
) -> ReadingsError:
    return ReadingsError(
        f"{readings.source}: {len(strange)} of the readings in '{readings.heading}' are about "
        f'{np.median(strange):.3g}, against {np.median(others_um):.3g} µm otherwise; they look '
        f'like {unit}: multiply them by {UNITS[unit]:g} or, if all are {unit}, say unit: '
        f'{{thickness: {unit}}} in the campaign'
    )


def geometry_by_experiment(campaign: Campaign, model: DepositionModel) -> dict[str, SprayGeometry]:
    """How the gun ran over each part, by the name of its experiment."""
    return {
        one.name: spray_geometry(one.surface, one.path, model, one.frame_id)
        for one in campaign.experiments
    }


def zeros_in_doubt(readings: Readings, expected_um: np.ndarray) -> str:
    """A warning of zeros where film (N,) [um] is expected; '' for none."""
    rows = (readings.thickness_um == 0.0) & (expected_um > THINNEST_FILM_UM)
    if readings.zero_is_film or not rows.any():
        return ''
    named = some(list(dict.fromkeys(readings.point[rows].tolist())), 6)
    low, high = expected_um[rows].min(), expected_um[rows].max()
    return (
        f'{np.count_nonzero(rows)} of {len(readings)} readings are 0 where the model expects '
        f'{low:.0f} to {high:.0f} µm (points {named}), and count as bare; gauges write 0 for '
        'what was not measured, too: write n/a for these, or say zero: missing in the campaign '
        '(zero: film if they are right)'
    )


def film_unit_in_doubt(readings: Readings, expected_um: np.ndarray) -> str:
    """A warning of films that agree with those expected (N,) [um] in another unit; '' for none."""
    there = (expected_um > THINNEST_FILM_UM) & (readings.thickness_um > 0.0)
    if not there.any():
        return ''
    ratio = float(np.median(readings.thickness_um[there] / expected_um[there]))
    for unit, exact in UNITS.items():
        for read_as, meant, factor in (('µm', unit, 1.0 / exact), (unit, 'µm', exact)):
            if factor / UNIT_SLACK < ratio < factor * UNIT_SLACK:
                return (
                    f'the readings are {ratio:.3g} times what the model expects: they look like '
                    f'{meant} read as {read_as}; write their unit in the heading, as in DFT [µm]'
                )
    return ''


def readings_in_doubt(
    surface: Surface, readings: Readings, expected_um: np.ndarray
) -> tuple[str, ...]:
    """Warnings of readings where film (N,) [um] is expected: their file, units and zeros."""
    found = (
        unit_in_doubt(surface, readings),
        film_unit_in_doubt(readings, expected_um),
        zeros_in_doubt(readings, expected_um),
    )
    return (*readings.doubts, *filter(None, found))


def targets_in_doubt(experiment: Experiment, target_um: float) -> Iterator[str]:
    """Warnings of targets that no reading is near, in place or in film.

    Args:
        target_um: of the film outside of zones; 0 is none.
    """
    film, found = experiment.readings.mean_um, experiment.zones_of_points
    number = np.full(len(film), NONE) if found is None else found.number
    wanted = [('the target', target_um, NONE)] if target_um else []
    zones = found.zones if found else ()
    wanted += [(f"zone '{one.name}'", one.target_um, k) for k, one in enumerate(zones)]
    for name, wanted_um, zone in wanted:
        own = film[number == zone]
        away = np.abs(np.log(np.maximum(own, NO_PAINT_UM) / wanted_um))
        if len(own) and np.all(away > np.log(1.5)):
            yield (
                f'no reading is near the {wanted_um:g} µm of {name}: {own.min():.4g} to '
                f'{own.max():.4g} µm were read; check the target and the unit of the readings'
            )
        if not len(own) and experiment.zones is not None and zone != NONE:
            vertices_m = experiment.surface.vertices_m[experiment.zones.number == zone]
            near_m = cKDTree(vertices_m).query(experiment.measured_points.positions_m)[0].min()
            yield (
                f'no reading is in {name} ({wanted_um:g} µm), the nearest is {near_m:.3f} m off: '
                'measure there, or check where the zone lies'
            )


def require_paint(campaign: Campaign, model: DepositionModel) -> tuple[str, ...]:
    """Refuse an experiment in which no paint lands at any measured point.

    Args:
        model: its pattern and projection count, its effects do not.

    Returns:
        Warnings of targets, positions and zeros that do not suit the readings. What is wrong
        with films is known once a model is fitted.
    """
    doubts = []
    plain = model.model_copy(update={'effects': ()})
    for one in campaign.experiments:
        try:
            plain.require_brushes(one.brushes)
        except ModelError as error:
            raise ModelError(f"experiment '{one.name}': {error}") from None
        painted = FilmIntegrator(one.measured_points, plain, 'double', parallel=False)
        painted.add(one.path)
        if painted.raw_um.max() >= NO_PAINT_UM:
            expected_um = painted.raw_um[one.readings.owner]
            target_um, _ = campaign.target_of(one)
            odd = [
                *targets_in_doubt(one, target_um),
                *one.readings.doubts,
                unit_in_doubt(one.surface, one.readings),
                zeros_in_doubt(one.readings, expected_um),
            ]
            doubts += [f'{one.name}: {doubt}' for doubt in odd if doubt]
            continue
        cause = 'the gun never sprays'
        if np.any(one.path.flow > 0.0):
            found = spray_geometry(one.surface, one.path, plain, one.frame_id)
            cause = found.warnings[0] if found.warnings else found.sentence
        raise ReadingsError(
            f"experiment '{one.name}': no paint lands where it was measured: {cause}"
        )
    return tuple(doubts)
