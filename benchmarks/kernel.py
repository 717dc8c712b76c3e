"""How fast the film is integrated: NumPy, a plain compiled loop and the kernel, side by side.

    python -m benchmarks.kernel [ROUNDS] [--json FILE]

All run in turns in one process, so that they share whatever else the machine does; each counts
with its best round. A pair is one sub-step of the gun's way and one surface point.
"""

import argparse
import json
import math
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from unittest.mock import patch

import numba
import numpy as np
from numba import njit, prange

import paint_deposition
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.files.meshes import read_mesh
from paint_deposition.files.motion_files import read_recording
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.kernel import blocks
from paint_deposition.kernel.compiler import KIND, kinds_at_hand
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.part.points import SurfacePoints
from reference import reference_film_um

PACKAGE = Path(paint_deposition.__file__).parents[1]
SAMPLES = PACKAGE / 'samples'
MODEL = DepositionModel()
# NumPy takes its time: it is measured on so many sub-steps, and checked on all.
NUMPY_STEPS = 24
LOOKING_DOWN = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Case:
    """Points, and the sub-steps on which the gun sprays."""

    name: str
    points: SurfacePoints
    path: SprayPath

    @property
    def pairs(self) -> int:
        return len(self.points) * len(self.path)

    @property
    def within_reach(self) -> float:
        """Share of the pairs within the pattern's reach: the others are skipped if may be."""
        offset, omega = MODEL.projection.emission_offset_m, MODEL.projection.model_plane_m
        shares = []
        for row in range(0, len(self.path), 20):
            tool = self.path.rotation[row]
            emission = self.path.position_m[row] - offset * tool[:, 2]
            x, y, z = ((self.points.positions_m - emission) @ tool).T
            inside = (z > offset) & (np.hypot(x, y) * omega < MODEL.reach_of_m(MODEL.planar) * z)
            shares.append(inside.mean())
        return float(np.mean(shares))


def dense() -> Case:
    """A plane under the gun: every pair is within the pattern's reach."""
    line = np.linspace(-0.4, 0.4, 128)
    x, y = (grid.ravel() for grid in np.meshgrid(line, line))
    points = SurfacePoints(np.stack([x, y, 0 * x], axis=1), np.tile([0.0, 0.0, 1.0], (len(x), 1)))
    count = 513
    positions = np.stack(
        [np.linspace(-0.15, 0.15, count), np.zeros(count), np.full(count, 0.25)], axis=1
    )
    stamps = 20_000_000 * np.arange(count, dtype=np.int64)
    log = Trajectory(stamps, positions, np.tile(LOOKING_DOWN, (count, 1)))
    return Case('dense', points, spray_path(log)[0])


def sample() -> Case:
    """The sample door at 10 mm, painted along the sample recording."""
    surface = read_mesh(SAMPLES / 'door.stl', max_edge_length_m=0.01)
    log = read_recording(SAMPLES / 'door_horizontal', None, '/atomizer/state')
    path = spray_path(log, max_step_m=MODEL.max_step_m)[0]
    return Case('sample door', surface.points(), path.select(path.flow > 0.0))


def numpy_um(case: Case, rows: slice) -> np.ndarray:
    """The film of some sub-steps by eq. (2) in NumPy, double precision."""
    return reference_film_um(case.points, case.path.select(rows), MODEL)


@njit(parallel=True)
def _plain(points, normals, tcp, rotation, weight, planar, omega, offset):
    """Eqs. (1) and (2) as they are written, one pair after the other."""
    k1, k2, k3, phi, r, s1, s2, gamma = planar
    film = np.zeros(len(points))
    for i in prange(len(points)):
        px, py, pz = points[i]
        nx, ny, nz = normals[i]
        for m in range(len(weight)):
            t = rotation[m]
            dx = px - (tcp[m, 0] - offset * t[0, 2])
            dy = py - (tcp[m, 1] - offset * t[1, 2])
            dz = pz - (tcp[m, 2] - offset * t[2, 2])
            along = dx * t[0, 2] + dy * t[1, 2] + dz * t[2, 2]
            facing = -(dx * nx + dy * ny + dz * nz)
            if along <= offset or facing <= 0.0:
                continue
            length = math.sqrt(dx * dx + dy * dy + dz * dz)
            x = omega / along * (dx * t[0, 0] + dy * t[1, 0] + dz * t[2, 0])
            y = omega / along * (dx * t[0, 1] + dy * t[1, 1] + dz * t[2, 1])
            rho = math.sqrt(x * x + y * y)
            f = 1.0 + k3 * math.sin(math.atan2(y, x) - phi)
            g1 = (
                math.exp(-((rho - r) ** 2) / (2.0 * s1**2))
                + math.exp(-((rho + r) ** 2) / (2.0 * s1**2))
            ) / gamma
            g2 = math.exp(-(rho**2) / (2.0 * s2**2)) / (2.0 * math.pi * s2**2)
            magnification = omega**2 * (facing / length) / (length**2 * (along / length) ** 3)
            flux = k1 * ((1.0 - k2) * f * g1 + k2 * g2)
            film[i] += weight[m] * magnification * flux
    return film


def plain_um(case: Case) -> np.ndarray:
    """The film by the plain compiled loop, double precision, all threads."""
    path, p = case.path, MODEL.planar
    planar = (p.K1_cm3_per_s, p.K2, p.K3, p.phi_rad, p.r_m, p.sigma1_m, p.sigma2_m, p.gamma_m2)
    return _plain(
        case.points.positions_m,
        case.points.normals,
        path.position_m,
        path.rotation,
        path.dwell_s * path.flow,
        planar,
        MODEL.projection.model_plane_m,
        MODEL.projection.emission_offset_m,
    )


def kernel_um(case: Case, integrator: FilmIntegrator) -> np.ndarray:
    """The film as the node and the command compute it."""
    integrator.reset()
    integrator.add(case.path)
    return integrator.film_um


def single_threaded(run: Callable[[], np.ndarray]) -> np.ndarray:
    """Run on one thread."""
    with patch.object(blocks, 'THREADS', 1):
        return run()


def measure(case: Case, rounds: int) -> dict[str, float]:
    """Print ns per pair, ratios and agreement; the pairs per second of each way."""
    single = FilmIntegrator(case.points, MODEL, 'single')
    double = FilmIntegrator(case.points, MODEL, 'double')
    step = max(1, len(case.path) // NUMPY_STEPS)
    some = slice(0, None, step)
    count = blocks.THREADS
    runs = {
        'NumPy, double, 1 thread': lambda: numpy_um(case, some),
        f'plain loop, double, {count} threads': lambda: plain_um(case),
        'kernel, double, 1 thread': lambda: single_threaded(lambda: kernel_um(case, double)),
        f'kernel, double, {count} threads': lambda: kernel_um(case, double),
        'kernel, single, 1 thread': lambda: single_threaded(lambda: kernel_um(case, single)),
        f'kernel, single, {count} threads': lambda: kernel_um(case, single),
    }
    best = dict.fromkeys(runs, math.inf)
    films = {name: run() for name, run in runs.items()}
    for _ in range(rounds):
        for name, run in runs.items():
            begin = time.perf_counter()
            run()
            best[name] = min(best[name], time.perf_counter() - begin)
    first = next(iter(runs))
    best[first] *= len(case.path) / len(range(len(case.path))[some])
    films[first] = numpy_um(case, slice(None))
    print(
        f'\n{case.name}: {len(case.points)} points x {len(case.path)} sub-steps, '
        f'{100 * case.within_reach:.0f} % of the pairs within reach'
    )
    print(f'{"":32}{"ns/pair":>9}{"whole":>10}{"x NumPy":>9}{"off by, of peak":>17}')
    for name, seconds in best.items():
        error = np.abs(films[name] - films[first]).max() / films[first].max()
        print(
            f'{name:32}{1e9 * seconds / case.pairs:9.2f}{seconds:8.3f} s'
            f'{best[first] / seconds:9.1f}{error:17.1e}'
        )
    return {name: case.pairs / seconds for name, seconds in best.items()}


def dense_on_one_thread() -> tuple[float, np.ndarray]:
    """Seconds and film of the dense case, single precision."""
    case = dense()
    integrator = FilmIntegrator(case.points, MODEL, 'single')
    begin = time.perf_counter()
    film_um = single_threaded(lambda: kernel_um(case, integrator))
    return time.perf_counter() - begin, film_um


def measure_kinds(rounds: int) -> dict[str, float]:
    """Print ns per pair of each kind of kernel, in turns; the pairs per second of each."""
    processes = {}
    for kind in kinds_at_hand():
        # Each compiles in a process of its own, which starts with its first task.
        with patch.dict(os.environ, NUMBA_CPU_NAME=kind):
            processes[kind] = ProcessPoolExecutor(1, get_context('spawn'))
            processes[kind].submit(dense_on_one_thread).result()
    turns = [
        {kind: process.submit(dense_on_one_thread).result() for kind, process in processes.items()}
        for _ in range(rounds)
    ]
    for process in processes.values():
        process.shutdown()
    pairs, (*_, oldest) = dense().pairs, processes
    best = {kind: min(turn[kind][0] for turn in turns) for kind in processes}
    film_um = {kind: film for kind, (_, film) in turns[0].items()}
    print('\nkinds of compiled kernel, single precision, 1 thread: ns/pair')
    for kind, seconds in best.items():
        apart = np.abs(film_um[kind] - film_um[oldest]).max() / film_um[oldest].max()
        print(f'{kind:32}{1e9 * seconds / pairs:9.2f}{apart:12.1e} of the peak off {oldest}')
    return {kind: pairs / seconds for kind, seconds in best.items()}


START = """
import time
begin = time.perf_counter()
import numpy as np
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.motion.path_builder import PathBuilder
from paint_deposition.motion.pose_stream import PoseBatch
from paint_deposition.part.points import SurfacePoints
from reference import reference_film_um
loaded = time.perf_counter()
points = SurfacePoints(np.zeros((64, 3)), np.tile([0.0, 0.0, 1.0], (64, 1)))
builder = PathBuilder()
builder.add_poses(PoseBatch.of([0, 10_000_000], np.full((2, 3), 0.3), np.eye(4)[[0, 0]]))
film = FilmIntegrator(points, DepositionModel())
film.add(builder.take(finish=True))
print(loaded - begin, time.perf_counter() - loaded)
"""


def measure_start() -> dict[str, float]:
    """Print how long a process takes to its first film, with and without compiled code on disk."""
    took = {}
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {'NUMBA_CACHE_DIR': folder}
        environment['PYTHONPATH'] = os.pathsep.join([str(PACKAGE), os.getenv('PYTHONPATH', '')])
        print('\nfirst film of a process:')
        for what in ('compiling everything', 'with compiled code on disk'):
            done = subprocess.run(
                [sys.executable, '-c', START], env=environment, capture_output=True, text=True,
                check=True,
            )  # fmt: skip
            loading, painting = (float(word) for word in done.stdout.split())
            print(f'  {what}: {loading:.2f} s loading libraries, {painting:.2f} s to the film')
            took[what] = loading + painting
    return took


def cpu_name() -> str:
    """What the processor calls itself."""
    path = Path('/proc/cpuinfo')
    lines = path.read_text().splitlines() if path.exists() else []
    names = [line.split(':')[1].strip() for line in lines if line.startswith('model name')]
    return names[0] if names else platform.processor() or 'unknown processor'


def main() -> None:
    """Measure all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('rounds', nargs='?', type=int, default=15)
    parser.add_argument('--json', type=Path, help='also write the figures to this file')
    given = parser.parse_args()
    load = os.getloadavg()[0]
    print(
        f'{cpu_name()} ({KIND}), {os.cpu_count()} cores, load '
        f'{load:.1f}; Python {platform.python_version()}, NumPy {np.__version__}, Numba '
        f'{numba.__version__}; best of {given.rounds}'
    )
    rates = {case.name: measure(case, given.rounds) for case in (dense(), sample())}
    kinds = measure_kinds(given.rounds)
    first_film = measure_start()
    if given.json:
        record = {'pairs_per_s': rates, 'kinds': kinds, 'first_film_s': first_film}
        given.json.write_text(json.dumps(record, indent=1), encoding='utf-8')


if __name__ == '__main__':
    main()
