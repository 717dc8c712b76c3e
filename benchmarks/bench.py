"""Everything that `make bench` measures, side by side and as one JSON record.

    python -m benchmarks.bench [--quick] [--output runs/bench]

Each benchmark runs in a process of its own, one after the other. With --quick the parts are small
and the runs short, to try it out.
"""

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

from benchmarks.file_to_film import RATE_HZ, exponent
from benchmarks.kernel import cpu_name

# The arguments of each, thorough and quick.
BENCHMARKS: dict[str, tuple[list[str], list[str]]] = {
    'kernel': ([], ['1']),
    'file_to_film': ([], ['2000', '20000', '--no-scaling']),
    'inference': ([], ['1']),
    'recommend': ([], ['3']),
    'live': ([], ['--vertices', '20000', '--seconds', '5']),
}
LIBRARIES = ('numpy', 'scipy', 'numba', 'trimesh', 'embreex', 'rclpy')
# Pairs of point and sub-step per second that the inner loops of other programs reached on the two
# cores of docs/measurements.md; the first is the better of two runs of one thread.
PEERS_PAIRS_PER_S = {'CY, C++, 1 thread': 78e6, 'PaintRL': 5.7e6, 'MA_Cobod': 0.32e6}


def measured(name: str, arguments: list[str], folder: Path) -> dict[str, Any]:
    """The record of a benchmark, whose own tables are printed as it runs."""
    print(f'\n=== {name}', flush=True)
    kept = folder / f'{name}.json'
    subprocess.run(
        [sys.executable, '-m', f'benchmarks.{name}', *arguments, '--json', str(kept)], check=True
    )
    return json.loads(kept.read_text())


def machine() -> dict[str, Any]:
    """Where and when it is measured."""
    return {
        'processor': cpu_name(),
        'cores': os.cpu_count(),
        'load': os.getloadavg()[0],
        'date': time.strftime('%Y-%m-%d'),
        'python': platform.python_version(),
        'libraries': {name: version(name) for name in LIBRARIES},
    }


def row(name: str, *cells: str) -> None:
    """Print a line of a table."""
    print(f'{name:44}' + ''.join(f'{cell:>13}' for cell in cells))


def print_rates(record: dict[str, Any]) -> None:
    """Ours and others' pairs per second."""
    print('\npairs of point and sub-step per second')
    ours = record['kernel']['pairs_per_s']
    row('', *ours)
    for name in next(iter(ours.values())):
        row(name, *(f'{rates[name] * 1e-6:.1f} M' for rates in ours.values()))
    for name, rate in PEERS_PAIRS_PER_S.items():
        row(name, f'{rate * 1e-6:.2f} M')


def print_sizes(record: dict[str, Any]) -> None:
    """Processor time and memory of every stage against the vertices."""
    tables = record['file_to_film']['sizes']
    print('\nfrom file to film: processor time, and most memory of the command')
    row('vertices', *(str(table['vertices']) for table in tables), 'power')
    for number, stage in enumerate(tables[0]['stages']):
        rows = [table['stages'][number] for table in tables]
        power = exponent([table['vertices'] for table in tables], rows) if len(rows) > 1 else 0.0
        row(stage['stage'], *(f'{one["processor_s"]:.2f} s' for one in rows), f'{power:.2f}')
    row('most memory', *(f'{table["stages"][-1]["memory_mb"]:.0f} MB' for table in tables))
    paths = record['file_to_film']['paths']
    for one in paths:
        sight = ', lines of sight traced' if one['occlusion'] else ''
        row(f'{one["length_m"]:.0f} m of path, {one["rate_hz"]:.0f} Hz{sight}',
            f'{one["processor_s"]:.2f} s', f'{one["memory_mb"]:.0f} MB')  # fmt: skip
    plain = [one for one in paths if one['rate_hz'] == RATE_HZ and not one['occlusion']]
    if len(plain) > 1:
        row('power of the length', f'{exponent([one["length_m"] for one in plain], plain):.2f}')


def print_live(record: dict[str, Any]) -> None:
    """What the simulator takes, by who watches."""
    print('\nlive, two guns at 250 Hz, by who watches')
    row(f'{record["live"]["vertices"]} vertices', 'processor', 'age 50 %', 'age 95 %', 'MB/s',
        'memory', 'ready')  # fmt: skip
    for one in record['live']['runs']:
        row(one['watched'], f'{one["processor_share"]:.0%}', f'{one["age_median_s"] * 1e3:.0f} ms',
            f'{one["age_95_s"] * 1e3:.0f} ms', f'{one["mb_per_s"]:.1f}',
            f'{one["memory_mb"]:.0f} MB', f'{one["ready_s"]:.2f} s')  # fmt: skip


def print_inference(record: dict[str, Any]) -> None:
    """What a diagnosis takes."""
    print(f'\na diagnosis of {record["inference"]["readings"]} readings: processor time')
    for name, stage in record['inference']['stages'].items():
        row(name, f'{stage["processor_s"]:.2f} s')


def print_answers(record: dict[str, Any]) -> None:
    """How soon an index is recommended."""
    print('\nrecommend_index, by effects along the rays')
    row('', 'first', 'again')
    for one in record['recommend']:
        row(f'{one["effects"]}, {one["request"]}', f'{one["first_ms"]:.0f} ms',
            f'{one["again_ms"]:.0f} ms')  # fmt: skip


def main() -> None:
    """Measure, print side by side, and keep the record."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--quick', action='store_true', help='small parts and short runs')
    parser.add_argument('--only', nargs='*', default=BENCHMARKS, help=', '.join(BENCHMARKS))
    parser.add_argument('--output', type=Path, default=Path('runs/bench'))
    given = parser.parse_args()
    record: dict[str, Any] = {'machine': machine(), 'quick': given.quick}
    with tempfile.TemporaryDirectory() as name:
        for benchmark in given.only:
            arguments = BENCHMARKS[benchmark][given.quick]
            record[benchmark] = measured(benchmark, arguments, Path(name))
    given.output.mkdir(parents=True, exist_ok=True)
    kept = given.output / time.strftime('%Y%m%d_%H%M%S.json')
    kept.write_text(json.dumps(record, indent=1), encoding='utf-8')
    print(f'\nrecord: {kept}')
    print('\n=== side by side')
    for name, show in (
        ('kernel', print_rates),
        ('file_to_film', print_sizes),
        ('live', print_live),
        ('inference', print_inference),
        ('recommend', print_answers),
    ):
        if name in record:
            show(record)


if __name__ == '__main__':
    main()
