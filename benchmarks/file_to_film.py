"""How long `paint simulate` takes from the files of a part and a motion to the film, by stages.

    python -m benchmarks.file_to_film [VERTICES ...] [--json FILE] [--no-scaling]

The part is the side of a body, 4.5 m by 1.5 m, crowned, with a belt line and a window, meshed
evenly, as a binary STL; the gun passes over it for 60 s, recorded at 250 Hz. Every size runs in a
process of its own. Times of the processor add up all threads; memory is the most that the process
held up to then.

Then what painting costs against the length of the path, the rate of its log and with lines of
sight traced, each in a process of its own, and the powers of vertices and length that it follows.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

SIZES = (10_000, 100_000, 1_000_000, 2_000_000)
LENGTH_M, HEIGHT_M = 4.5, 1.5
SECONDS, RATE_HZ = 60.0, 250.0
PASSES, STANDOFF_M = 4, 0.25
COARSER_THAN_ANY_M = 1.0
# Vertices of the runs over different paths: passes, rate of the log [Hz], and lines of sight.
SCALED_VERTICES = 100_000
PATHS = ((2, RATE_HZ, False), (4, RATE_HZ, False), (8, RATE_HZ, False), (16, RATE_HZ, False),
         (4, 1000.0, False), (4, RATE_HZ, True))  # fmt: skip


def body_side(vertices: int) -> tuple[np.ndarray, np.ndarray]:
    """About that many vertices (V, 3) [m], and faces (F, 3) outward to -y."""
    across = max(4, round((vertices * LENGTH_M / HEIGHT_M / 0.9) ** 0.5))
    up = max(4, round(across * HEIGHT_M / LENGTH_M))
    x, z = np.meshgrid(np.linspace(0, LENGTH_M, across), np.linspace(0, HEIGHT_M, up))
    crown = 0.15 * (2.0 * z / HEIGHT_M - 1.0) ** 2 + 0.08 * (2.0 * x / LENGTH_M - 1.0) ** 2
    belt = 0.6 * np.maximum(0.0, z - 0.95)
    corners = np.stack([x, crown + belt, z], axis=2).reshape(-1, 3)
    row, column = np.meshgrid(np.arange(up - 1), np.arange(across - 1), indexing='ij')
    a = (row * across + column).ravel()
    b, c, d = a + 1, a + across, a + across + 1
    quads = np.stack([np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)], axis=1)
    middle = corners[quads.reshape(-1, 6)].mean(axis=1)
    window = (np.abs(middle[:, 0] - 2.2) < 0.8) & (np.abs(middle[:, 2] - 1.2) < 0.2)
    return corners, quads[~window].reshape(-1, 3)


def write_stl(path: Path, corners: np.ndarray, faces: np.ndarray) -> None:
    """A binary STL of corners (V, 3) [m] and faces (F, 3)."""
    triangles = np.zeros(len(faces), dtype=[('n', '<f4', 3), ('v', '<f4', (3, 3)), ('a', '<u2')])
    triangles['v'] = corners[faces]
    path.write_bytes(bytes(80) + np.uint32(len(faces)).tobytes() + triangles.tobytes())


def write_inputs(
    folder: Path, vertices: int, passes: int = PASSES, rate_hz: float = RATE_HZ
) -> None:
    """Write part.stl and the recording gun/ to the folder; all passes are equally fast."""
    from paint_deposition.files.recordings.bags import write_pose_bag
    from paint_deposition.motion.trajectory import Trajectory

    corners, faces = body_side(vertices)
    write_stl(folder / 'part.stl', corners, faces)
    count = int(SECONDS / PASSES * passes * rate_hz)
    share = np.arange(count) / count * passes
    row, along = np.divmod(share, 1.0)
    x = LENGTH_M * np.where(row % 2 == 0, along, 1.0 - along)
    z = HEIGHT_M * (row + 0.5) / passes
    positions = np.stack([x, np.full(count, -STANDOFF_M), z], axis=1)
    toward_the_part = np.sqrt(0.5) * np.array([-1.0, 0.0, 0.0, 1.0])
    stamps = (1e9 / rate_hz * np.arange(count)).astype(np.int64) + 1_762_246_800_000_000_000
    log = Trajectory(stamps, positions, np.tile(toward_the_part, (count, 1)), 'part')
    write_pose_bag(folder / 'gun', log)


class Stages:
    """Wall and processor time of each piece of work, in the order of the work."""

    def __init__(self) -> None:
        self.rows: list[dict[str, Any]] = []

    def of(self, name: str, work: Callable[[], Any]) -> Any:
        """Do the work and note what it took."""
        wall, processor = time.perf_counter(), time.process_time()
        result = work()
        wall_s, processor_s = time.perf_counter() - wall, time.process_time() - processor
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        self.rows.append(
            {'stage': name, 'wall_s': wall_s, 'processor_s': processor_s, 'memory_mb': memory}
        )
        return result


def run_stages(folder: Path, occlusion: bool) -> dict[str, Any]:
    """What `paint simulate` does, one stage after the other, in this process."""
    stages = Stages()
    paint = stages.of('loading the libraries', _load)
    log = stages.of('reading the recording', lambda: paint.read_recording(folder / 'gun'))
    mesh = (folder / 'part.stl', 1.0, COARSER_THAN_ANY_M)
    surface = stages.of('reading the mesh', lambda: paint.read_mesh(*mesh))
    model = paint.DepositionModel()
    if occlusion:
        from paint_deposition.effects.catalogue import EFFECTS

        model = model.with_effect(EFFECTS['occlusion'].typical())
    film = stages.of('painting', lambda: paint.simulate(surface, log, model))
    stages.of('writing and drawing', lambda: paint.write(film, folder / 'film'))
    return {'vertices': len(surface.vertices_m), 'stages': stages.rows}


def _load() -> Any:
    import paint_deposition as paint

    for name in ('read_recording', 'read_mesh', 'simulate', 'write'):
        getattr(paint, name)
    return paint


def run_command(folder: Path) -> dict[str, float]:
    """The command itself, as its user starts it."""
    command = [
        'paint', 'simulate', '--mesh', str(folder / 'part.stl'), '--trajectory',
        str(folder / 'gun'), '--max-edge-length-m', str(COARSER_THAN_ANY_M), '-o',
        str(folder / 'out'),
    ]  # fmt: skip
    wall = time.perf_counter()
    done = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, used = os.wait4(done.pid, 0)
    if status:
        raise SystemExit(f'{" ".join(command)}: failed')
    return {
        'wall_s': time.perf_counter() - wall,
        'processor_s': used.ru_utime + used.ru_stime,
        'memory_mb': used.ru_maxrss / 1024,
    }


def stages_in_a_process(folder: Path, occlusion: bool = False) -> dict[str, Any]:
    """The stages, in a process of their own."""
    inner = [sys.executable, __file__, '--stages-of', str(folder)]
    inner += ['--occlusion'] if occlusion else []
    done = subprocess.run(inner, stdout=subprocess.PIPE, check=True)
    return json.loads(done.stdout)


def compile_first() -> None:
    """Run what is measured on a small part, so that all compiled code is on disk."""
    with tempfile.TemporaryDirectory() as name:
        write_inputs(Path(name), 1000)
        for occlusion in (False, True):
            stages_in_a_process(Path(name), occlusion)


def measure(vertices: int) -> dict[str, Any]:
    """Stages in a process, then the command."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_inputs(folder, vertices)
        told = stages_in_a_process(folder)
        told['stages'].append({'stage': 'paint simulate', **run_command(folder)})
    return told


def measure_paths() -> list[dict[str, Any]]:
    """What painting costs on paths of different length and rate, and with lines of sight."""
    rows = []
    for passes, rate_hz, occlusion in PATHS:
        with tempfile.TemporaryDirectory() as name:
            write_inputs(Path(name), SCALED_VERTICES, passes, rate_hz)
            told = stages_in_a_process(Path(name), occlusion)
        (painting,) = (row for row in told['stages'] if row['stage'] == 'painting')
        length_m = passes * LENGTH_M
        about = {'passes': passes, 'length_m': length_m, 'rate_hz': rate_hz}
        rows.append(about | {'occlusion': occlusion, **painting})
    return rows


def exponent(amounts: list[float], rows: list[dict[str, Any]]) -> float:
    """The power of an amount that the processor time follows."""
    seconds = [row['processor_s'] for row in rows]
    return float(np.polyfit(np.log(amounts), np.log(seconds), 1)[0])


def print_scaling(tables: list[dict[str, Any]], paths: list[dict[str, Any]]) -> None:
    """Painting against length, rate and lines of sight, and the powers that it follows."""
    print(
        f'\n{"painting, " + str(SCALED_VERTICES) + " vertices":34}{"processor":>11}{"memory":>10}'
    )
    for row in paths:
        name = f'{row["length_m"]:.0f} m of path, {row["rate_hz"]:.0f} Hz'
        name += ', lines of sight' if row['occlusion'] else ''
        print(f'{name:34}{row["processor_s"]:9.2f} s{row["memory_mb"]:7.0f} MB')
    plain = [row for row in paths if row['rate_hz'] == RATE_HZ and not row['occlusion']]
    print(
        f'cost follows length to the power {exponent([r["length_m"] for r in plain], plain):.2f}'
    )
    for stage in ('reading the mesh', 'painting') if len(tables) > 1 else ():
        rows = [row for t in tables for row in t['stages'] if row['stage'] == stage]
        power = exponent([t['vertices'] for t in tables], rows)
        print(f'{stage}: cost follows vertices to the power {power:.2f}')


def main() -> None:
    """Measure all sizes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('vertices', nargs='*', type=int, default=SIZES)
    parser.add_argument('--json', type=Path, help='also write the figures to this file')
    parser.add_argument('--no-scaling', action='store_true', help='only the sizes')
    parser.add_argument('--stages-of', type=Path, help=argparse.SUPPRESS)
    parser.add_argument('--occlusion', action='store_true', help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.stages_of:
        print(json.dumps(run_stages(given.stages_of, given.occlusion)))
        return
    print(f'{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}')
    compile_first()
    tables = []
    for vertices in given.vertices:
        table = measure(vertices)
        tables.append(table)
        print(f'\n{table["vertices"]:9} vertices{"":16}{"wall":>9}{"processor":>11}{"memory":>10}')
        for row in table['stages']:
            print(
                f'{row["stage"]:34}{row["wall_s"]:7.2f} s{row["processor_s"]:9.2f} s'
                f'{row["memory_mb"]:7.0f} MB'
            )
    paths = [] if given.no_scaling else measure_paths()
    if paths:
        print_scaling(tables, paths)
    if given.json:
        record = {'sizes': tables, 'paths': paths}
        given.json.write_text(json.dumps(record, indent=1), encoding='utf-8')


if __name__ == '__main__':
    main()
