"""A better model, a more even door: paint, measure, diagnose, choose the speeds again, paint.

Panel and doors are painted in the virtual paint shop of the tests, which shares no code with the
model: only it knows what is hidden, and what film there is between the readings.
"""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.programme import Evenness, Painted, driven
from tests.virtual_paint_shop.draw import draw_jobs, stream
from tests.virtual_paint_shop.files import write
from tests.virtual_paint_shop.gauge import GaugeNoise, scatter
from tests.virtual_paint_shop.shop import generate
from tests.virtual_paint_shop.truths import choose

from paint_deposition.files.motion_files import read_recording
from paint_deposition.report.words import effect_name

SEED, HIDDEN, SCALE = 640004, 'incidence_attraction~power', 2.5
PARCELS = 2_000_000
NOISE = GaugeNoise(floor_um=0.5, relative=0.005)
READINGS, JUDGED = 60, 400
TARGET_UM = 20
# The gun of the shop stands this far before the model plane's origin.

Paint = Callable[..., str]


def level(folder: Path, paint: Paint, say: Callable[[str], None]) -> Path:
    """Go once round the loop; returns the folder of the improved programme.

    Args:
        folder: for campaigns and results.
        paint: runs a command of the package.
        say: prints a heading.
    """
    folder = folder / 'even_door'
    truths = choose(HIDDEN, stream(SEED, 1), None, SCALE)
    pattern, (_, job) = draw_jobs(SEED, truths, ('panel', 'door'), 'outside')
    panel = generate(SEED, HIDDEN, experiments=('panel',), readings=READINGS, repeats=0,
                     heldout=1, noise=NOISE, scale=SCALE, parcels=PARCELS)  # fmt: skip
    judged = scatter(job.part, JUDGED, stream(SEED, 90), 0.0)

    def painted(name: str, trajectory: Path) -> Painted:
        motion = driven(read_recording(trajectory, state_topic='/atomizer/state'))
        return Painted(name, job.part, pattern, truths, motion, SEED, PARCELS)

    say('Calibrating a bell on a panel, and planning a door with it')
    paint('calibrate', write(panel, folder / 'panel', sigma_column=True), '-o',
          folder / 'calibration', show=True)  # fmt: skip
    mesh = folder / 'door.stl'
    trimesh.Trimesh(*job.part.mesh(), process=False).export(mesh)
    paint('plan', '--mesh', mesh, '--model', folder / 'calibration/model.yaml', '--target-um',
          TARGET_UM, '--optimise', '-o', folder / 'plan', show=True)  # fmt: skip

    say(f'Painting that door in the virtual shop, measuring {READINGS} points, diagnosing')
    door = painted('door', folder / 'plan/trajectory')
    spots = scatter(job.part, READINGS, stream(SEED, 91), 0.015)
    both = replace(panel, experiments=(*panel.experiments, door.measured(*spots, NOISE)))
    campaign = write(both, folder / 'measured', sigma_column=True)
    paint('diagnose', campaign, '-o', folder / 'diagnosis', show=True)

    say('Choosing the speeds again with what was found, and painting the next door')
    better = folder / 'better'
    paint('improve', '--mesh', mesh, '--trajectory', folder / 'plan/trajectory', '--model',
          folder / 'diagnosis/model.yaml', '--target-um', TARGET_UM, '-o', better,
          show=True)  # fmt: skip
    again = painted('next door', better / 'trajectory')

    say('Comparing with readings of the next door, which no fit has seen')
    measured = replace(panel, experiments=(again.measured(*spots, NOISE),))
    paint('compare', write(measured, folder / 'next_door', sigma_column=True),
          '--model', folder / 'diagnosis/model_before.yaml',
          '--model', folder / 'diagnosis/model.yaml', '-o', folder / 'unseen',
          show=True)  # fmt: skip

    say('For the sceptic: the true films of both doors')
    hidden = effect_name(HIDDEN.partition('~')[0])
    print(f'hidden          {hidden}, by another law than that of the library')
    print(f'wanted          mean {TARGET_UM} µm')
    for name, one in (('first door', door), ('next door', again)):
        print(f'{name:<15} {_in_words(one.film_um(*judged))}')
    return better


def _in_words(film_um: np.ndarray) -> str:
    film = Evenness.of(film_um)
    return (
        f'mean {film.mean_um:.1f} µm, sigma_n {100 * film.sigma_n:.1f} %, '
        f'{100 * film.within:.0f} % of it within 5 % of its mean'
    )
