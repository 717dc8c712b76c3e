"""Draw the pictures of the documentation again, with the commands that the documentation names.

Run it in the project's environment, with nothing behind it for all pictures, or with `build` for
the film as it builds up, `layers` for the layers in architecture.svg, `profiles` for real ones
(their tables lie beside the repository), `results` for the rest:
`. setup/environment.sh; python docs/draw_images.py build`.
"""

import json
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

import paint_deposition as paint
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.model.eq3_collapse import ThreeGaussianCollapse
from paint_deposition.report.colour_scales import ACCENT, INK
from paint_deposition.report.drawing import legend, new_figure, quiet, save_picture

ROOT = Path(__file__).resolve().parent.parent
SAMPLES = ROOT / 'ros2_ws/src/paint_deposition/samples'
IMAGES = ROOT / 'docs/images'
LARGEST_BYTES = 350_000
WIDEST_PX = 1280

# The moving picture: frames a second, how much faster than the robot, the last frame's time [s].
FRAMES_PER_S, SPEED_UP, REST_S = 12, 3.0, 2.5
LARGEST_FILM_UM = 24.0
ZONES = """zones:
  - {name: sill, target_um: 15, tolerance_um: 2, box: [[-1, -1, -1], [1, 1, 0.1]]}
  - {name: outer skin, target_um: 20, tolerance_um: 3, box: [[-1, -1, 0.1], [1, 1, 0.5]]}
"""


def main() -> None:
    """Draw what is named on the command line, or everything."""
    drawn = {'build': draw_build, 'layers': draw_layers, 'profiles': draw_profiles,
             'results': draw_results}  # fmt: skip
    for name in sys.argv[1:] or drawn:
        drawn[name]()


def draw_build() -> None:
    """The film on the sample door while the gun moves, from the simulation of each moment."""
    door = paint.read_mesh(SAMPLES / 'door.stl', max_edge_length_m=0.02)
    motion = paint.read_recording(SAMPLES / 'door_horizontal', state_topic='/atomizer/state')
    step_ns = round(1e9 * SPEED_UP / FRAMES_PER_S)
    moments = np.arange(motion.stamps_ns[0] + step_ns, motion.stamps_ns[-1] + step_ns, step_ns)
    frames = [frame(door, up_to(motion, moment)) for moment in moments]
    path = IMAGES / 'film-build.gif'
    frames[0].save(
        path, save_all=True, append_images=frames[1:], loop=0, optimize=True,
        duration=[1000 // FRAMES_PER_S] * (len(frames) - 1) + [round(1000 * REST_S)],
    )  # fmt: skip
    check_size(path, 1_500_000)


def up_to(motion: paint.Trajectory, moment_ns: int) -> paint.Trajectory:
    """The motion until a moment."""
    poses = motion.stamps_ns <= moment_ns
    changes = motion.trigger_stamps_ns <= moment_ns
    changes[0] = True  # without any change the gun would spray throughout
    return replace(
        motion,
        stamps_ns=motion.stamps_ns[poses],
        positions_m=motion.positions_m[poses],
        quaternions_xyzw=motion.quaternions_xyzw[poses],
        trigger_stamps_ns=motion.trigger_stamps_ns[changes],
        trigger_flow=motion.trigger_flow[changes],
        trigger_brush=motion.trigger_brush[changes] if len(motion.trigger_brush) else changes[:0],
    )


def frame(door: paint.Surface, motion: paint.Trajectory) -> Image.Image:
    """The film at the end of a motion, seen from the gun, with the path and the bell."""
    try:
        film_um = paint.simulate(door, motion).film_um
    except paint.PaintError:  # the gun has not opened yet
        film_um = np.zeros(len(door.vertices_m))
    spraying = motion.trigger_flow[-1] > 0.0
    figure, axes = plt.subplots(figsize=(8.4, 5.0), dpi=100, layout='constrained')
    x, _, z = door.vertices_m.T
    levels = np.linspace(0.0, LARGEST_FILM_UM, 33)
    shown = axes.tricontourf(x, z, door.faces, film_um, levels=levels, extend='max')
    path = motion.positions_m[:, [0, 2]]
    axes.plot(*path.T, color='white', linewidth=3.0)
    axes.plot(*path.T, color='#333333', linewidth=1.0)
    axes.plot(*path[-1], 'o', markersize=15, color='#e4572e' if spraying else '#999999', mec='w')
    axes.set(
        xlim=(-0.85, 0.85), ylim=(-0.05, 0.95), aspect='equal', xlabel='x [m]', ylabel='z [m]'
    )
    mean_um = np.average(film_um, weights=door.vertex_areas_m2)
    axes.set_title(f'{motion.duration_s:4.1f} s, mean film {mean_um:4.1f} µm', loc='left')
    figure.colorbar(shown, ax=axes, label='film [µm]', ticks=range(0, 25, 4), shrink=0.85)
    figure.canvas.draw()
    picture = Image.fromarray(np.asarray(figure.canvas.buffer_rgba())).convert('RGB')
    plt.close(figure)
    return picture.quantize(96, dither=Image.Dither.NONE)


def draw_layers() -> None:
    """Put the layers that the linter holds into the picture of the architecture."""
    settings = (ROOT / 'pyproject.toml').read_text(encoding='utf-8')
    (held,) = re.findall(r'exhaustive = true\nlayers = \[(.*?)\]', settings, re.DOTALL)
    rows = []
    layers = re.findall(r"'(.+?)'", held)
    step = 390 // len(layers)
    for number, layer in enumerate(layers):
        name = ' '.join(layer.split(' | '))
        rows.append(
            f'    <rect class="layer" y="{step * number}" width="205" height="{step - 5}" rx="4"/>'
            f'<text class="room" x="102" y="{step * number + step // 2 + 2}">{name}</text>\n'
        )
    path = IMAGES / 'architecture.svg'
    old = path.read_text(encoding='utf-8')
    new = re.sub(r'(    <rect class="layer" .*\n)+', lambda _: ''.join(rows), old)
    path.write_text(new, encoding='utf-8')


def draw_profiles() -> None:
    """What other people measured, and eqs. (1) to (3) as the tests fit them to it."""
    fits = json.loads((ROOT / 'tests/inference/fitting/real_profiles.json').read_text())
    tables = [
        np.loadtxt(ROOT.parent / 'shared/data' / name, delimiter=',', skiprows=1).T
        for name in ('travelling_gun_transect_1d_collapse.csv',
                     'magnetron_static_radial_130mm.csv',
                     'hvof_wc17co_thickness_angle_standoff.csv')
    ]  # fmt: skip
    (station_ft, depth_in), (_, radius_mm, share), (angle, standoff_mm, thickness_um, *_) = tables
    figure = new_figure(13.0, 4.0)
    left, middle, right = figure.subplots(1, 3)
    quiet(left, 'station [ft]', 'depth [in]', 'Moving sprinkler: eq. (3)')
    x = np.linspace(-160.0, 160.0, 400)
    left.plot(
        x, ThreeGaussianCollapse(**fits['eq3']).thickness_um(x), color=ACCENT, label='eq. (3)'
    )
    left.plot(station_ft, depth_in, 'o', color=INK, markersize=5, label='measured')
    quiet(middle, 'radius [mm]', 'thickness', 'Static magnetron at 130 mm: eq. (1)')
    r = np.linspace(0.0, 300.0, 400)
    pattern = PlanarPattern(**fits['eq1'])
    middle.plot(r, pattern.flux_um_per_s(1e-3 * r, 0.0), color=ACCENT, label='eq. (1)')
    middle.plot(radius_mm, share / 100.0, 'o', color=INK, markersize=5, label='measured')
    quiet(right, 'spray angle [deg]', 'thickness [µm]', 'HVOF coating: eq. (2)')
    upright_um = thickness_um[angle == 90.0].mean()
    a = np.linspace(20.0, 90.0, 200)
    right.plot(a, upright_um * np.sin(np.radians(a)), color=ACCENT, label='cosine law')
    for distance in np.unique(standoff_mm):
        at = standoff_mm == distance
        right.plot(angle[at], thickness_um[at], 'o', markersize=5, label=f'{distance:g} mm')
    for axes in (left, middle, right):
        axes.set_ylim(bottom=0.0)
        legend(axes)
    save_picture(figure, IMAGES / 'real-profiles.png')


def draw_results() -> None:
    """Run the commands on the samples and keep their pictures."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run('calibrate', SAMPLES / 'panel_study/campaign.yaml', '-o', folder / 'calibration')
        run('recommend', '--model', folder / 'calibration/model.yaml', '--target-um', 20,
              '--tolerance', 0.05, '--width', 0.9, '-o', folder / 'index')  # fmt: skip
        keep(Image.open(folder / 'index/uniformity.png'), 'uniformity.png')
        run('measure', '--mesh', SAMPLES / 'measured_door/door.stl', '--trajectory',
              SAMPLES / 'measured_door/door', '-o', folder / 'measure')  # fmt: skip
        keep(Image.open(folder / 'measure/points.png'), 'measure.png')
        run('inspect', SAMPLES / 'door_horizontal', '--mesh', SAMPLES / 'door.stl',
              '--state-topic', '/atomizer/state',
              '--out', folder / 'inspect.png')  # fmt: skip
        keep(Image.open(folder / 'inspect.png'), 'inspect.png')
        zones = folder / 'zones.yaml'
        zones.write_text(ZONES)
        run('simulate', '--mesh', SAMPLES / 'door.stl', '--trajectory',
              SAMPLES / 'door_horizontal', '--state-topic', '/atomizer/state',
              '--zones', zones, '-o', folder / 'film')  # fmt: skip
        film = Image.open(folder / 'film/film.png')
        # The upper panel with the figures of the zones beneath its histogram.
        keep(film.crop((0, 0, film.width, int(0.508 * film.height))), 'zones.png')
        run('diagnose', SAMPLES / 'measured_door/campaign.yaml', '-o', folder / 'diagnosis')
        keep(of_the_door(Image.open(folder / 'diagnosis/comparison.png')), 'diagnosis.png')
        run('plan', '--mesh', SAMPLES / 'door.stl', '--model',
              folder / 'diagnosis/model_before.yaml', '--target-um', 20,
              '-o', folder / 'plan')  # fmt: skip
        run('improve', '--mesh', SAMPLES / 'door.stl', '--trajectory',
              folder / 'plan/trajectory', '--model', folder / 'diagnosis/model.yaml',
              '--target-um', 20, '-o', folder / 'better')  # fmt: skip
        keep(Image.open(folder / 'better/improvement.png'), 'improve.png', 1150)
        run('place', '--trajectory', folder / 'plan/trajectory',
              '--urdf', SAMPLES / 'robot.urdf', '--part-pose', 1.8, 0, 0.5, 0, 0,
              -0.7071068, 0.7071068, '-o', folder / 'place')  # fmt: skip
        keep(Image.open(folder / 'place/place.png'), 'place.png')
        first_page(folder / 'diagnosis/report.html', folder / 'report.png')
        if (folder / 'report.png').exists():
            keep(Image.open(folder / 'report.png'), 'report.png')


def run(command: str, *arguments: object) -> None:
    """Run the command line."""
    subprocess.run([ROOT / 'paint', command, *map(str, arguments)], check=True)


def of_the_door(profiles: Image.Image) -> Image.Image:
    """The legend and the lower half, where the door's four columns are."""
    width, height = profiles.size
    legend, door = int(0.045 * height), int(0.525 * height)
    picture = Image.new('RGB', (width, legend + height - door), 'white')
    picture.paste(profiles.crop((0, 0, width, legend)), (0, 0))
    picture.paste(profiles.crop((0, door, width, height)), (0, legend))
    return picture


def first_page(report: Path, picture: Path) -> None:
    """Take a screenshot of the report, if there is a browser."""
    browser = shutil.which('chromium') or shutil.which('google-chrome')
    if browser is None:
        return  # without a browser the old picture stays
    subprocess.run(
        [browser, '--headless', '--no-sandbox', '--disable-gpu', '--hide-scrollbars',
         '--window-size=1280,1280', '--virtual-time-budget=15000', f'--screenshot={picture}',
         report.as_uri()],
        check=True, stderr=subprocess.DEVNULL,
    )  # fmt: skip


def keep(picture: Image.Image, name: str, widest_px: int = WIDEST_PX) -> None:
    """Save a picture no wider than the pages show it, with all its colours."""
    path = IMAGES / name
    picture = picture.convert('RGB')
    picture.thumbnail((widest_px, widest_px), Image.Resampling.LANCZOS)
    picture.save(path, optimize=True)
    check_size(path, LARGEST_BYTES)


def check_size(path: Path, most_bytes: int) -> None:
    """Stop where a picture is too large for a page."""
    if path.stat().st_size > most_bytes:
        raise SystemExit(f'{path} has {path.stat().st_size} bytes, more than {most_bytes}')


if __name__ == '__main__':
    main()
