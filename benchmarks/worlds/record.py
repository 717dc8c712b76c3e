"""A campaign of a world: what a user would have of it as files, and what only the judge knows."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh
import yaml
from scipy.linalg import block_diag
from tests.virtual_paint_shop.files import POSE_TOPIC, STATE_TOPIC, write_bag

# Kinds of truth: nothing hidden, effects of the library, a cause in no library, a strange pattern.
KINDS = ('clean', 'effect', 'pair', 'unknown', 'footprint')


@dataclass(frozen=True)
class Part:
    """A painted part: mesh, log of the motion, readings (n rows) and unseen points (u)."""

    name: str
    vertices_m: np.ndarray
    faces: np.ndarray
    stamps_ns: np.ndarray
    positions_m: np.ndarray  # of the TCP
    quaternions_xyzw: np.ndarray
    trigger_stamps_ns: np.ndarray
    trigger_on: np.ndarray
    read_m: np.ndarray  # (n, 3)
    point: np.ndarray  # (n,) repeats share a label
    thickness_um: np.ndarray  # (n,) as read
    sigma_um: np.ndarray | None  # (n,) as stated, None where repeats must tell
    unseen_m: np.ndarray  # (u, 3)
    unseen_um: np.ndarray  # (u,) by a gauge without noise, the part's own remainder left out
    unseen_sigma_um: np.ndarray  # (u,) of one reading there: gauge and remainder

    def write(self, folder: Path) -> dict:
        """Write mesh, bag and readings; return the campaign's entry."""
        mesh = trimesh.Trimesh(self.vertices_m, self.faces, process=False)
        mesh.export(folder / f'{self.name}.stl')
        write_bag(self, folder / self.name)
        _write_csv(folder / f'{self.name}.csv', self.read_m, self.point, self.thickness_um,
                   self.sigma_um)  # fmt: skip
        return {
            'name': self.name,
            'mesh': f'{self.name}.stl',
            'trajectory': self.name,
            'pose_topic': POSE_TOPIC,
            'state_topic': STATE_TOPIC,
            'measurements': f'{self.name}.csv',
            'down': [0.0, 0.0, -1.0],
        }


@dataclass(frozen=True)
class Painted:
    """A campaign and its truth.

    Attributes:
        hidden: ids of the effects, or `unknown:...` or `footprint:...`.
        strengths: of each hidden cause, in standard deviations, see ``detectability``.
        strength: of all of them together.
        amounts: true values of parameters, `effect.parameter`, where the package's law means the
            same quantity.
        level, zero_um: standard deviations of a part's level, as a share, and of its gauge's zero.
    """

    world: str
    seed: int
    kind: str
    hidden: tuple[str, ...]
    parts: tuple[Part, ...]
    strength: float
    strengths: tuple[float, ...]
    amounts: dict[str, float]
    level: float
    zero_um: float
    facts: dict = field(default_factory=dict)

    def write(self, folder: Path) -> Path:
        """Write the campaign's files into a new folder and return its `campaign.yaml`.

        `unseen.yaml` beside it is the same campaign with the unseen points, noise-free.
        """
        folder.mkdir(parents=True)
        entries = [part.write(folder) for part in self.parts]
        unseen = []
        for part, entry in zip(self.parts, entries, strict=True):
            name = f'unseen_{part.name}.csv'
            labels = np.array([f'U{k + 1:03d}' for k in range(len(part.unseen_m))])
            _write_csv(folder / name, part.unseen_m, labels, part.unseen_um, part.unseen_sigma_um)
            unseen.append(entry | {'measurements': name})
        for name, listed in (('campaign', entries), ('unseen', unseen)):
            (folder / f'{name}.yaml').write_text(yaml.safe_dump({'experiments': listed}))
        return folder / 'campaign.yaml'


class Judged(NamedTuple):
    """What a judge needs of the P points of a part, all in um.

    Attributes:
        marks: (P, m) change by all that is hidden together, then by each cause.
        pattern: (P, k) change by what is free in the pattern, each in its standard deviation.
        own: (P, n) the same by what is the part's own.
        sigma: (P,) independent noise of the point means.
    """

    marks: np.ndarray
    pattern: np.ndarray
    own: np.ndarray
    sigma: np.ndarray


def strengths(parts: Sequence[Judged]) -> list[float]:
    """Of all that is hidden together, then of each cause; see ``detectability``."""
    marks, pattern, own, sigma = zip(*parts, strict=True)
    free = np.hstack([np.concatenate(pattern), block_diag(*own)])
    return detectability(np.concatenate(marks), free, np.concatenate(sigma)).tolist()


def detectability(marks: np.ndarray, free: np.ndarray, sigma_um: np.ndarray) -> np.ndarray:
    """Size of marks (P, m) in standard deviations, all that is free fitted around them.

    Args:
        marks: change of P point means by each cause [um].
        free: (P, k) what else may change the readings, each in its standard deviation [um].
        sigma_um: (P,) independent noise of the means.
    """
    white, columns = marks / sigma_um[:, None], free / sigma_um[:, None]
    inner = np.eye(columns.shape[1]) + columns.T @ columns
    along = columns.T @ white
    left = np.sum(white**2, axis=0) - np.sum(along * np.linalg.solve(inner, along), axis=0)
    return np.sqrt(np.maximum(left, 0.0))


def grid_mesh(height: np.ndarray, x: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of y = height (nz, nx) over x (nx,) and z (nz,), seen from +y."""
    across, up = np.meshgrid(x, z)
    vertices = np.stack([across, height, up], axis=-1).reshape(-1, 3)
    first = (np.arange(len(z) - 1)[:, None] * len(x) + np.arange(len(x) - 1)).ravel()
    above = first + len(x)
    faces = np.concatenate([
        np.stack([first, above, first + 1], 1), np.stack([first + 1, above, above + 1], 1)
    ])  # fmt: skip
    return vertices, faces


def trigger(begun_ns: int, open_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stamps [ns] and states of a trigger that is off first and open from and to (passes, 2)."""
    stamps = begun_ns + np.rint(1e9 * np.append(0.0, open_s.ravel())).astype(np.int64)
    return stamps, np.append(False, np.tile([True, False], len(open_s)))


def amounts(hidden: dict[str, dict]) -> dict[str, float]:
    """Sizes in the parameters of the library, where both mean the same."""
    meant = {
        'tcp_offset': lambda h: {'offset_x_m': h['m'][0], 'offset_y_m': h['m'][1]},
        'tcp_tilt': lambda h: {'tilt_x_rad': h['rad'][0], 'tilt_y_rad': h['rad'][1]},
        'tcp_standoff': lambda h: {'offset_z_m': h['m']},
        'air_drift': lambda h: {'shift_down_m': -h['m'][2], 'shift_across_m': -h['m'][0]},
        'gun_wake': lambda h: {'lag_s': h['s']},
        'pose_lag': lambda h: {'lag_s': h['s']},
        'overspray_fog': lambda h: {'fog_um': h['um']},
        'gauge_zero': lambda h: {'offset_um': h['um']},
    }
    return {
        f'{name}.{key}': float(value)
        for name, sizes in hidden.items()
        if name in meant
        for key, value in meant[name](sizes).items()
    }


def _write_csv(path, positions_m, point, thickness_um, sigma_um) -> None:
    rows = zip(positions_m.tolist(), thickness_um.tolist(), point.tolist(), strict=True)
    with path.open('w', newline='') as file:
        out = csv.writer(file)
        head = ['x_m', 'y_m', 'z_m', 'thickness_um', 'point']
        out.writerow(head if sigma_um is None else [*head, 'sigma_um'])
        for k, (place, thickness, label) in enumerate(rows):
            stated = [] if sigma_um is None else [round(float(sigma_um[k]), 3)]
            out.writerow([*(round(v, 5) for v in place), round(thickness, 3), label, *stated])
