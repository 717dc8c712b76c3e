"""A further part, painted otherwise, in the same hidden world as a campaign's parts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from .draw import stream, timed
from .jobs import Job, Plan, hold
from .shop import PARCELS, USUAL_NOISE, Bench, Campaign, Experiment, gauged
from .truths import Scene, Truth

# A part's own level of film, as a share, and its gauge session's own zero [um].
LEVEL, SESSION_UM = 0.03, 0.3
# Share of the paint that still arrives without voltage.
WITHOUT_VOLTAGE = 0.75
STANDOFF_STEP_M, LONGER_OPEN_S = 0.06, 0.3
# What vanishes with the field, and with the booth's air.
OF_VOLTAGE = ('convex_attraction', 'edge_build', 'faraday_shielding')
OF_DRAUGHT = ('air_drift',)


def sprayed_again(
    campaign: Campaign, truths: list[Truth], name: str, changes: Sequence[str], seed: int, *,
    stand: Mapping[str, float] | None = None, parcels: int = PARCELS,
) -> Campaign:  # fmt: skip
    """The campaign and another part like that of an experiment, with changes; the same points.

    stand: where the gun stands (x_m, y_m, z_m), how far off (standoff_m), how long open (dwell_s).
    Teaching, level, zero and noise are drawn anew; the hidden effects and the bell are the same.
    """
    rng = stream(seed, 60)
    experiment = next(e for e in campaign.experiments if e.name == name)
    part, plan = experiment.part, experiment.plan
    for change in changes:
        plan = PLANS[change](plan, part)
    if stand is None:
        plan, motion = timed(part, plan, rng)
    else:
        place = np.array([stand[f'{axis}_m'] for axis in 'xyz'])
        motion = hold(part, plan, place, stand['standoff_m'], stand['dwell_s'])
        truths = [_less_fog(t, experiment, stand['dwell_s']) for t in truths]
    arriving = plan.flow
    if 'voltage' in plan.switched_off:
        truths = [t for t in truths if t.id not in OF_VOLTAGE]
        arriving *= WITHOUT_VOLTAGE
    if 'draught' in plan.switched_off:
        truths = [t for t in truths if t.id not in OF_DRAUGHT]
    if plan.upside_down:
        truths = [_upside_down(t) for t in truths]
    _, first = np.unique(experiment.readings.point, return_index=True)
    x, _, z = experiment.readings.positions_m[np.sort(first)].T
    job = Job(f'{experiment.name}_next', part, plan, motion)
    sprayed = replace(campaign.pattern, K1_cm3_per_s=arriving * campaign.pattern.K1_cm3_per_s)
    bench = Bench(seed, job, sprayed, parcels)
    films = *bench.readings(truths, x, z), bench.readings([], x, z)[0]
    level, offset = 1.0 + LEVEL * rng.normal(), SESSION_UM * rng.normal()
    again = gauged(job, x, z, films, USUAL_NOISE, level, offset, rng)
    return replace(campaign, experiments=(*campaign.experiments, again))


def _longer_open(plan: Plan, part) -> Plan:
    margin = plan.gun_margin_m + LONGER_OPEN_S * plan.speed_m_per_s
    return replace(plan, gun_margin_m=margin, overrun_m=max(plan.overrun_m, margin + 0.04))


def _turned(plan: Plan, part) -> Plan:
    """As many passes the other way, spread over the part's other side, and the gun with them."""
    direction = 'vertical' if plan.direction == 'horizontal' else 'horizontal'
    wider = part.width_m / part.height_m
    index = plan.index_m * (wider if direction == 'vertical' else 1.0 / wider)
    return replace(plan, direction=direction, index_m=index, roll_rad=plan.roll_rad - 0.5 * np.pi)


def _plus(name: str, more):
    return lambda plan, part: replace(plan, **{name: getattr(plan, name) + more})


def _times(name: str, factor: float):
    return lambda plan, part: replace(plan, **{name: factor * getattr(plan, name)})


PLANS = {
    'roll_180': _plus('roll_rad', np.pi),
    'roll_90': _plus('roll_rad', 0.5 * np.pi),
    'reverse_order': lambda plan, part: replace(plan, from_below=not plan.from_below),
    'other_way': lambda plan, part: replace(plan, other_way=not plan.other_way),
    'further': _plus('standoff_m', STANDOFF_STEP_M),
    'closer': _plus('standoff_m', -STANDOFF_STEP_M),
    'half_flow': _times('flow', 0.5),
    'double_flow': _times('flow', 2.0),
    'half_speed': _times('speed_m_per_s', 0.5),
    'double_speed': _times('speed_m_per_s', 2.0),
    'longer_open': _longer_open,
    'turned': _turned,
    'upside_down': lambda plan, part: replace(plan, upside_down=not plan.upside_down),
    'voltage_off': _plus('switched_off', ('voltage',)),
    'draught_off': _plus('switched_off', ('draught',)),
    'standing': lambda plan, part: plan,  # see `stand`
}


def _less_fog(truth: Truth, experiment: Experiment, open_s: float) -> Truth:
    """Fog comes from what is sprayed: a spot makes less of it than a whole part."""
    if truth.id not in ('fog_gradient', 'overspray_fog'):
        return truth
    stamps, on = experiment.log.trigger_stamps_ns, experiment.log.trigger_on
    whole_s = 1e-9 * float(np.sum(np.diff(stamps)[on[:-1]]))
    return replace(truth, amplitude=truth.amplitude * open_s / whole_s)


def _upside_down(truth: Truth) -> Truth:
    if truth.id == 'air_drift':
        return replace(truth, drawn={'direction': -np.asarray(truth.drawn['direction'])})
    if truth.id in ('fog_gradient', 'sag'):
        return _Film(truth.amplitude, {'truth': truth})
    return truth


class _Film(Truth):
    """A truth of gravity on the film, as a part sees it that hangs upside down, in its frame."""

    def on_film(self, film_um, x, z, scene: Scene, film_at):
        truth, top = self.drawn['truth'], scene.part.height_m
        turned = -x, top - z
        return truth.on_film(film_um, *turned, scene, lambda x, z: film_at(-x, top - z))
