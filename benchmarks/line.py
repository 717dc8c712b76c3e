"""A line of virtual parts through `paint line`: two processes, one of them killed.

The clean film of the programme is by eqs. (1) and (2) in NumPy, the hidden drift of the air is
that of the virtual paint shop, by another law than the model's. It is too small for one door. At
three fifths of the line K1 falls by 4 %. The gauge's readings are then drawn again and again, to
count false alarms and parts until the step is found.
"""

import json
import os
import shutil
import signal
import subprocess
import time
from dataclasses import replace
from pathlib import Path

import click
import numpy as np
from benchmarks.records import ROOT, model_of
from tests.reference import reference_film_um
from tests.virtual_paint_shop.draw import stream
from tests.virtual_paint_shop.gauge import measure
from tests.virtual_paint_shop.line import (
    LINE_NOISE,
    Hidden,
    film_um,
    painted_job,
    taken_on,
    write_line,
)
from tests.virtual_paint_shop.shop import Campaign as Job

from paint_deposition.batch.cases import ResultCache
from paint_deposition.batch.line.changes import (
    changes_of,
    series_of,
)
from paint_deposition.batch.line.pooling import (
    Measured,
    measured_parts,
    pooled,
)
from paint_deposition.batch.line.runs import line_cases
from paint_deposition.files.gauge_readings import read_readings
from paint_deposition.files.meshes import read_mesh
from paint_deposition.files.motion_files import read_recording
from paint_deposition.motion.path_builder import spray_path

FOLDER = ROOT / 'runs' / 'bench-line'
HIDDEN, AMPLITUDE_M, STEP = 'air_drift', 0.02, 0.96
POINTS, A_PART, PARCELS = 36, 12, 16_000_000


def smooth(job: Job, aside: Path) -> Job:
    """The job with the clean film of eqs. (1) and (2): the shop's own is grainy."""
    write_line(job, aside, 1, Hidden())
    run = next(path for path in aside.iterdir() if path.is_dir())
    surface = read_mesh(aside / 'door.stl', max_edge_length_m=0.03)
    path, _ = spray_path(read_recording(run, state_topic='/atomizer/state'))
    readings = read_readings(run.with_suffix('.csv'))
    model = model_of(job.truth['pattern'])
    clean = reference_film_um(surface.at(readings.positions_m), path, model)
    (part,) = job.experiments
    marks = part.readings.expected_um - part.readings.clean_um
    table = replace(
        part.readings, clean_um=clean, film_um=clean + marks, expected_um=clean + marks
    )
    return replace(job, experiments=(replace(part, readings=table),))


def computed_though_one_is_killed(folder: Path, output: Path, count: int) -> dict:
    """`paint line` with two processes, one of which is killed half-way."""
    began = time.monotonic()
    command = ['paint', 'line', str(folder), '-o', str(output), '--workers', '2', '--json']
    running = subprocess.Popen(command, stdout=subprocess.PIPE)
    while running.poll() is None and len(list(output.glob('finished/*'))) < count // 2:
        time.sleep(0.5)
    done = len(list(output.glob('finished/*')))
    children = Path(f'/proc/{running.pid}/task/{running.pid}/children').read_text().split()
    os.kill(int(children[-1]), signal.SIGKILL)
    content, _ = running.communicate()
    if running.returncode:
        raise SystemExit(running.returncode)
    return json.loads(content) | {'seconds': time.monotonic() - began, 'killed_at': done}


def repeated(parts: list[Measured], count: int) -> list[Measured]:
    """A longer line of the same parts over and over; what is predicted of them stays."""
    whole = len(parts) - len(parts) % (POINTS // A_PART)
    apart_s = parts[1].time_s - parts[0].time_s
    return [
        replace(parts[k % whole], name=f'part_{k}', time_s=parts[0].time_s + apart_s * k)
        for k in range(count)
    ]


def redrawn(parts: list[Measured], job: Job, hidden: Hidden, seed: int) -> list[Measured]:
    """The same parts measured anew, with what ``hidden`` tells."""
    found, points = [], job.experiments[0].readings.point
    for row, part in enumerate(parts):
        film = film_um(job, row, len(parts), hidden)
        shown = measure(points, film, film, LINE_NOISE, stream(10_000 * seed + row, 81))
        taken = taken_on(row, len(points), A_PART)
        found.append(replace(part, residual_um=shown.thickness_um[taken] - part.predicted_um))
    return found


def score(parts: list[Measured], step_at: int) -> dict:
    """Alarms before a step, parts until an alarm of the level after it, and what is pooled."""
    together = pooled(parts)
    series = series_of(parts, together)
    times = np.array([part.time_s for part in parts])
    alarms = [rows[rows < step_at] for one in series for rows in one.charts.alarms.values()]
    level = np.concatenate(list(series[0].charts.alarms.values()))
    after = level[level >= step_at]
    changes = changes_of(series, times)
    level_steps = [c for c in changes if c.series == 'level' and abs(c.part - step_at) <= 10]
    return {
        'false_alarms': sum(map(len, alarms)),
        'delay': int(after.min()) - step_at + 1 if len(after) else None,
        'dated': bool(level_steps),
        'off_by': abs(level_steps[0].part - step_at) if level_steps else None,
        'other_changes': len(changes) - len(level_steps),
        'found': any(HIDDEN in cause.members for cause in together.causes),
        'first': together.causes[0].members if together.causes else (),
        'one_part': together.causes[0].one_part if together.causes else 0.0,
    }


@click.command()
@click.option('--parts', 'count', default=500, show_default=True)
@click.option('--redrawn-parts', 'length', default=500, show_default=True)
@click.option('--redraws', default=20, show_default=True)
@click.option('--seed', default=3, show_default=True)
def main(count: int, length: int, redraws: int, seed: int) -> None:
    shutil.rmtree(FOLDER, ignore_errors=True)
    FOLDER.mkdir(parents=True)
    job = smooth(painted_job(seed, HIDDEN, AMPLITUDE_M, POINTS, PARCELS), FOLDER / 'one')
    step_at = 3 * count // 5
    hidden = Hidden(step_at=step_at, step=STEP)
    folder, output = FOLDER / 'line', FOLDER / 'results'
    write_line(job, folder, count, hidden, points_a_part=A_PART)
    told = computed_though_one_is_killed(folder, output, count)
    size = sum(path.stat().st_size for path in output.glob('*.parquet'))
    print(f'{count} parts, {told["points"]} readings: {told["seconds"]:.0f} s with two processes, '
          f'one killed after {told["killed_at"]} parts; {told["measured"]} parts computed, '
          f'{len(told["errors"])} errors')  # fmt: skip
    print(f'tables: {size / count:.0f} bytes a part')
    for change in told['changes']:
        print(f'changed: {change["sentence"]}')
    for cause in told['pooled']['causes']:
        print(f'shared: {cause["members"]}, {cause["one_part"]:.1f} standard deviations in one '
              f'part, {cause["all_parts"]:.1f} in all')  # fmt: skip
    cases, *_ = line_cases(folder)
    table = ResultCache(output / 'finished').table(case.digest for case in cases)
    parts = repeated(measured_parts(table.to_pylist()), length)
    step_at = 3 * length // 5
    hidden = replace(hidden, step_at=step_at)
    began = time.process_time()
    steady = [score(redrawn(parts, job, Hidden(first=0.0, last=0.0), k), length)
              for k in range(redraws)]  # fmt: skip
    stepped = [score(redrawn(parts, job, hidden, redraws + k), step_at) for k in range(redraws)]
    each = (time.process_time() - began) / (2 * redraws)
    print(f'{redraws} lines without step or effect: '
          f'{sum(one["false_alarms"] for one in steady)} alarms and '
          f'{sum(one["other_changes"] for one in steady)} changes in {redraws * length} parts; '
          f'an effect was pooled in {sum(bool(one["first"]) for one in steady)}')  # fmt: skip
    delays = sorted(one['delay'] for one in stepped if one['delay'])
    print(f'{redraws} lines with both: {sum(one["dated"] for one in stepped)} steps dated, off by '
          f'{np.median([one["off_by"] for one in stepped if one["dated"]]):.0f} parts (median); '
          f'alarm after {np.median(delays):.0f} parts (median), {max(delays)} at most; '
          f'{sum(one["false_alarms"] for one in stepped)} alarms before; '
          f'{HIDDEN} among the causes in {sum(one["found"] for one in stepped)}')  # fmt: skip
    print(f'pooling, charts and changes of {length} parts: {each:.1f} s of the processor')


if __name__ == '__main__':
    main()
