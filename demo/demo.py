"""`paint demo`, then what needs nodes or a shop that paints again.

Starts the real nodes as processes, paints the door of `paint demo` live, records the run, checks
it against the offline film, asks the planner, settles another diagnosis by the spray that it
proposes, and paints a more even door by what a diagnosis found. Takes two minutes.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NoReturn

import numpy as np
import rclpy
from ament_index_python.packages import get_package_prefix, get_package_share_directory
from domain_coordinator import domain_id
from even_door import level
from paint_msgs.srv import SaveFilm
from rosbags.highlevel import AnyReader
from std_srvs.srv import Trigger
from what_next import settle

from nodes import Cell
from paint_deposition.files.motion_files import read_recording

PACKAGE = 'paint_deposition'
PREFIX = Path(get_package_prefix(PACKAGE)) / 'lib' / PACKAGE
SAMPLES = Path(get_package_share_directory(PACKAGE)) / 'samples'
DOOR, TRAJECTORY = SAMPLES / 'measured_door/door.stl', SAMPLES / 'measured_door/door'
# A folder with this file holds the results of a demo, which the next demo may replace.
MARKER = '.paint_demo'


def main() -> None:
    """Run the demo. The results go to the given folder; those of an older demo are replaced."""
    if len(sys.argv) != 2:
        refuse('give one folder for the results')
    folder = fresh_folder(Path(sys.argv[1]).resolve())
    paint('demo', '--no-open', '-o', folder, show=True)
    with domain_id() as domain:
        # The nodes talk among themselves, whatever else runs on this machine.
        os.environ['ROS_DOMAIN_ID'] = str(domain)
        rclpy.init()
        run, film_csv = paint_live(folder)
        compare_films(film_csv, run, folder / 'film' / 'film.csv')
        recommend()
        rclpy.shutdown()
    settled = settle(folder, paint, say)
    better = level(folder, paint, say)
    say('Results')
    for what, path in (
        ('the recorded run, for ros2 bag, Foxglove or rosbags', run),
        ('the painted door as a coloured mesh', film_csv.with_suffix('.ply')),
        ('the story of that door, for a browser', folder / 'demo.html'),
        ('the report that says what to spray next', folder / 'one_door_diagnosis' / 'report.html'),
        ('the report after that spray', settled / 'report.html'),
        ('the programme of the more even door, for an ABB robot', better / 'passes.mod'),
        ('its film before and after', better / 'improvement.png'),
    ):
        print(f'  {what}:\n    {path}')


def fresh_folder(folder: Path) -> Path:
    """The folder, emptied if it holds an older demo; any other must be empty or not exist."""
    if folder.exists() and not (folder / MARKER).is_file():
        if not folder.is_dir() or any(folder.iterdir()):
            refuse(f'{folder} exists and is not from an older demo; give another folder')
    elif folder.exists():
        shutil.rmtree(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / MARKER).write_text('Made by demo/demo.py, which may replace this folder.\n')
    return folder


def refuse(why: str) -> NoReturn:
    """End with one line."""
    print(f'demo: {why}', file=sys.stderr)
    sys.exit(2)


def paint_live(folder: Path) -> tuple[Path, Path]:
    """Paint the door through the nodes; returns the recorded run and the film's table."""
    say('Painting the same door live, through the nodes')
    poses = len(read_recording(TRAJECTORY, state_topic='/atomizer/state'))
    with Cell(PREFIX) as cell:
        cell.start('deposition_simulator', mesh_file=DOOR, max_edge_length_m=0.01,
                   output_directory=folder)  # fmt: skip
        cell.start('run_recorder', output_directory=folder)
        cell.wait_for_service(SaveFilm, 'deposition_simulator/save_film')
        cell.wait_for_service(Trigger, 'run_recorder/stop')
        cell.start('bag_player', bag=TRAJECTORY, state_topic='/atomizer/state', rate=0.0,
                   wait_for_subscribers=2)  # fmt: skip
        stats = cell.follow_poses(poses)
        cell.wait_for_end('bag_player')
        paths = cell.save_film('live')
        run = cell.stop_recorder()
    print(
        f'{stats.poses_received} poses, {stats.poses_rejected} rejected; film thickness '
        f'{stats.mean_um:.1f} µm mean, {stats.std_dev_um:.1f} µm standard deviation, '
        f'{100 * stats.coverage:.0f} % covered, capture fraction '
        f'{100 * stats.capture_fraction:.0f} %'
    )
    return run, next(path for path in paths if path.suffix == '.csv')


def compare_films(live_csv: Path, run: Path, offline_csv: Path) -> None:
    """Print how far the live and the recorded film differ from the offline one."""
    offline = np.loadtxt(offline_csv, delimiter=',', skiprows=1)[:, 3]
    live = np.loadtxt(live_csv, delimiter=',', skiprows=1)[:, 3]
    with AnyReader([run]) as reader:
        fields = [c for c in reader.connections if c.topic.endswith('thickness/field')]
        *_, (connection, _, raw) = reader.messages(connections=fields)
        recorded = reader.deserialize(raw, connection.msgtype).thickness_um
    for name, film in (('live', live), ('recorded', recorded)):
        off = np.abs(film - offline).max() / offline.max()
        print(f'{name} and offline film differ by at most {off:.1e} of the peak')


def recommend() -> None:
    """Ask the running planner for an index."""
    say('Asking the running planner for an index')
    with Cell(PREFIX) as cell:
        cell.start('index_planner')
        answer = cell.recommend_index(target_um=20.0, tolerance=0.05, width_m=0.9)
    print(answer.message)


def paint(*arguments, show: bool = False) -> str:
    """Run the command; returns what it printed."""
    command = [str(PREFIX / 'paint'), *map(str, arguments)]
    done = subprocess.run(
        command, stdout=None if show else subprocess.PIPE, text=True, check=False
    )
    if done.returncode:
        sys.exit(f'demo: `paint {arguments[0]}` ended with exit code {done.returncode}')
    return done.stdout or ''


def say(line: str) -> None:
    """Print a heading."""
    print(f'\n{line}\n{"-" * len(line)}', flush=True)


if __name__ == '__main__':
    main()
