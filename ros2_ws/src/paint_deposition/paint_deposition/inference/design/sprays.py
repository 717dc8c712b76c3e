"""Sprays that a cell can do instead of the one that was recorded."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np
from scipy.spatial import cKDTree

from paint_deposition.inference.readings.campaign import Experiment
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.points import across_axis

# The gun opens this much earlier and closes this much later than it did [s].
LONGER_OPEN_S = 0.3


@dataclass(frozen=True)
class Change:
    """What is done otherwise than in a recorded spray."""

    key: str  # one word, or two for two changes at once
    words: str  # complete 'the same passes ...'
    # Gives the experiment painted that way, or None where the part does not allow it.
    made: Callable[[Experiment], Experiment | None]
    kind: str  # changes of one kind exclude each other
    # 1 for an entry in the programme; more where someone must lay hands on part or cell.
    cost: float = 1.0


def together(first: Change, second: Change) -> Change:
    """Both changes in one spray."""

    def made(experiment: Experiment) -> Experiment | None:
        changed = first.made(experiment)
        return None if changed is None else second.made(changed)

    key, words = f'{first.key} {second.key}', f'{first.words} and {second.words}'
    return Change(key, words, made, '', first.cost + second.cost)


def pairs(changes: Sequence[Change]) -> Iterator[Change]:
    """Two of these changes at once, where they do not exclude each other."""
    for first, second in combinations(changes, 2):
        if first.kind != second.kind:
            yield together(first, second)


def _on_path(
    change: Callable[..., SprayPath], *values: float
) -> Callable[[Experiment], Experiment]:
    """A change of the path alone, by a function of it and these values."""
    return lambda experiment: replace(experiment, path=change(experiment.path, *values))


def _of_the_nearest_opening(path: SprayPath) -> SprayPath:
    """Closed sub-steps with the brush of the opening that is nearest in time."""
    opened = np.flatnonzero(path.flow > 0.0)
    following = np.minimum(np.searchsorted(opened, np.arange(len(path))), len(opened) - 1)
    before = (path.flow == 0.0) & (path.until_on_s < path.since_off_s)
    return path.with_(brush=np.where(before, path.brush[opened[following]], path.brush))


def _rolled(path: SprayPath, angle_deg: float) -> SprayPath:
    cos, sin = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return path.with_(rotation=path.rotation @ turn)


def _other_way(path: SprayPath) -> SprayPath:
    """Each pass from its end to its begin, the passes in the same order."""
    path = _of_the_nearest_opening(path)
    time_s = path.time_s.copy()
    for number in np.unique(path.spray_pass[path.spray_pass >= 0]):
        rows = path.spray_pass == number
        time_s[rows] = time_s[rows].min() + time_s[rows].max() - time_s[rows]
    return path.with_(
        time_s=time_s,
        velocity_m_per_s=-path.velocity_m_per_s,
        since_on_s=path.until_off_s,
        until_off_s=path.since_on_s,
        since_off_s=path.until_on_s,
        until_on_s=path.since_off_s,
        from_turn_m=path.to_turn_m,
        to_turn_m=path.from_turn_m,
    )


def _other_order(path: SprayPath) -> SprayPath:
    """The last pass first, each run the same way."""
    backward = _other_way(path)
    spraying = path.spray_pass >= 0
    number = np.where(spraying, path.spray_pass.max() - path.spray_pass, -1)
    ends_s = path.time_s.min() + path.time_s.max()
    time_s = ends_s - backward.time_s
    return path.with_(spray_pass=number, passes_before=np.maximum(number, 0), time_s=time_s)


def _moved_off(experiment: Experiment, distance_m: float) -> Experiment | None:
    path = experiment.path
    if distance_m < 0.0:
        spraying = path.position_m[path.flow > 0.0]
        standoff, _ = cKDTree(experiment.surface.vertices_m).query(spraying)
        # The gun comes no nearer to the part [m].
        if standoff.min() + distance_m < 0.12:
            return None
    position = path.position_m - distance_m * path.rotation[:, :, 2]
    return replace(experiment, path=path.with_(position_m=position))


def _at_speed(path: SprayPath, factor: float) -> SprayPath:
    times = ('time_s', 'dwell_s', 'since_on_s', 'since_off_s', 'until_on_s', 'until_off_s')
    slower = {name: getattr(path, name) / factor for name in times}
    return path.with_(velocity_m_per_s=factor * path.velocity_m_per_s, **slower)


def _open_longer(path: SprayPath) -> SprayPath:
    """The gun opens earlier and closes later, where the path goes on that long."""
    path = _of_the_nearest_opening(path)
    closed = path.flow == 0.0
    early = closed & (path.until_on_s < LONGER_OPEN_S)
    late = closed & (path.since_off_s < LONGER_OPEN_S)
    opened = early | late
    since_on = np.where(early, LONGER_OPEN_S - path.until_on_s, path.since_on_s + LONGER_OPEN_S)
    until_off = np.where(late, LONGER_OPEN_S - path.since_off_s, path.until_off_s + LONGER_OPEN_S)
    return path.with_(
        flow=np.where(opened, path.open_flow, path.flow),
        since_on_s=since_on,
        until_off_s=until_off,
        since_off_s=np.maximum(path.since_off_s - LONGER_OPEN_S, 0.0),
        until_on_s=np.maximum(path.until_on_s - LONGER_OPEN_S, 0.0),
    )


def _passes_turned(experiment: Experiment) -> Experiment | None:
    """Turn the passes by 90 deg and fit them to the part's other side, at the same speed."""
    surface, path = experiment.surface, experiment.path
    outward = surface.outward
    across = across_axis(outward, surface.down)
    along = np.cross(outward, across)
    frame = np.column_stack([across, along, outward])
    vertices = surface.vertices_m @ frame
    # On a deeper part passes cannot be turned [m].
    if np.ptp(vertices[:, 2]) > 0.15:
        return None
    low, high = vertices[:, :2].min(axis=0), vertices[:, :2].max(axis=0)
    middle, share = 0.5 * (low + high), (high - low)[::-1] / (high - low)
    plane = path.position_m @ frame
    there = ((plane[:, :2] - middle) * share)[:, ::-1] * [-1.0, 1.0] + middle
    tree = cKDTree(vertices[:, :2])
    spraying = path.flow > 0.0
    _, below = tree.query(plane[:, :2])
    standoff = float(np.median((plane[:, 2] - vertices[below, 2])[spraying]))
    _, below = tree.query(there)
    position = np.column_stack([there, vertices[below, 2] + standoff]) @ frame.T
    quarter = frame @ np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]) @ frame.T
    stretch = np.array([[0.0, -share[1], 0.0], [share[0], 0.0, 0.0], [0.0, 0.0, 0.0]])
    velocity = path.velocity_m_per_s @ frame @ stretch.T @ frame.T
    changed = path.with_(
        position_m=position, rotation=quarter @ path.rotation, velocity_m_per_s=velocity
    )
    # Passes that are longer or shorter now take as much more or less time.
    state = np.abs(path.velocity_m_per_s @ frame)[spraying].sum(axis=0)[:2]
    return replace(experiment, path=_at_speed(changed, 1.0 / share[np.argmax(state)]))


def _upside_down(experiment: Experiment) -> Experiment:
    surface = replace(experiment.surface, down=-experiment.surface.down)
    return replace(experiment, surface=surface).with_readings(experiment.readings)


def _without(experiment: Experiment, setting: str) -> Experiment:
    return replace(experiment, switched_off=experiment.switched_off | {setting})


AS_BEFORE = Change('', '', lambda experiment: experiment, '', 0.0)
MENU = (
    Change(
        'roll_180', 'with the gun rolled 180 deg about its axis', _on_path(_rolled, 180.0), 'roll'
    ),
    Change(
        'roll_90', 'with the gun rolled 90 deg about its axis', _on_path(_rolled, 90.0), 'roll'
    ),
    Change('reverse_order', 'in reverse order', _on_path(_other_order), 'order'),
    Change('other_way', 'with every pass reversed', _on_path(_other_way), 'way'),
    Change('further', '60 mm farther off', partial(_moved_off, distance_m=0.06), 'standoff'),
    Change('closer', '60 mm closer', partial(_moved_off, distance_m=-0.06), 'standoff'),
    Change('half_flow', 'at half the flow', _on_path(SprayPath.with_flow_scaled, 0.5), 'film'),
    Change('double_flow', 'at twice the flow', _on_path(SprayPath.with_flow_scaled, 2.0), 'film'),
    Change('half_speed', 'at half the speed', _on_path(_at_speed, 0.5), 'film'),
    Change('double_speed', 'at twice the speed', _on_path(_at_speed, 2.0), 'film'),
    Change(
        'longer_open', 'with the gun opened 0.3 s earlier and closed 0.3 s later',
        _on_path(_open_longer), 'trigger',
    ),
    Change('turned', 'with path and gun turned by 90 deg', _passes_turned, 'passes', 2.0),
    Change(
        'upside_down', 'with part and passes turned upside down',
        _upside_down, 'part', 2.0,
    ),
    Change(
        'voltage_off', 'with the high voltage off', partial(_without, setting='voltage'),
        'voltage', 2.0,
    ),
    Change(
        'draught_off', 'with the booth air off, if safety allows',
        partial(_without, setting='draught'), 'draught', 3.0,
    ),
)  # fmt: skip
