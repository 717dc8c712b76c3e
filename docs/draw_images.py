"""Draw the pictures of the documentation again, with the commands that the documentation names.

Run it in the project's environment: `. setup/environment.sh; python docs/draw_images.py`.
"""

import shutil
import subprocess
import tempfile
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parent.parent
SAMPLES = ROOT / 'ros2_ws/src/paint_deposition/samples'
IMAGES = ROOT / 'docs/images'
LARGEST_BYTES = 300_000
WIDEST_PX = 1250


def main() -> None:
    """Run the commands on the samples and keep their pictures."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        paint('simulate', '--mesh', SAMPLES / 'door.stl', '--trajectory',
              SAMPLES / 'door_horizontal', '--state-topic', '/atomizer/state',
              '-o', folder / 'film')  # fmt: skip
        keep(Image.open(folder / 'film/film.png'), 'door.png')
        paint('calibrate', SAMPLES / 'panel_study/campaign.yaml', '-o', folder / 'calibration')
        paint('recommend', '--model', folder / 'calibration/model.yaml', '--target-um', 20,
              '--tolerance', 0.05, '--width', 0.9, '-o', folder / 'index')  # fmt: skip
        keep(Image.open(folder / 'index/uniformity.png'), 'uniformity.png')
        paint('measure', '--mesh', SAMPLES / 'measured_door/door.stl', '--trajectory',
              SAMPLES / 'measured_door/door', '-o', folder / 'measure')  # fmt: skip
        keep(Image.open(folder / 'measure/points.png'), 'measure.png')
        paint('diagnose', SAMPLES / 'measured_door/campaign.yaml', '-o', folder / 'diagnosis')
        keep(of_the_door(Image.open(folder / 'diagnosis/comparison.png')), 'diagnosis.png')
        paint('plan', '--mesh', SAMPLES / 'door.stl', '--model',
              folder / 'diagnosis/model_before.yaml', '--target-um', 20,
              '-o', folder / 'plan')  # fmt: skip
        paint('improve', '--mesh', SAMPLES / 'door.stl', '--trajectory',
              folder / 'plan/trajectory', '--model', folder / 'diagnosis/model.yaml',
              '--target-um', 20, '-o', folder / 'better')  # fmt: skip
        keep(Image.open(folder / 'better/improvement.png'), 'improve.png')
        first_page(folder / 'diagnosis/report.html', folder / 'report.png')
        if (folder / 'report.png').exists():
            keep(Image.open(folder / 'report.png'), 'report.png')


def paint(command: str, *arguments: object) -> None:
    """Run the command line."""
    subprocess.run([ROOT / 'paint', command, *map(str, arguments)], check=True)


def of_the_door(profiles: Image.Image) -> Image.Image:
    """The legend and the lower half, where the door's four columns are."""
    width, height = profiles.size
    legend, door = int(0.045 * height), int(0.518 * height)
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


def keep(picture: Image.Image, name: str) -> None:
    """Save a picture no wider than the pages show it, with all its colours."""
    path = IMAGES / name
    picture = picture.convert('RGB')
    picture.thumbnail((WIDEST_PX, WIDEST_PX), Image.Resampling.LANCZOS)
    picture.save(path, optimize=True)
    size = path.stat().st_size
    if size > LARGEST_BYTES:
        raise SystemExit(f'{path} has {size} bytes, more than {LARGEST_BYTES}')


if __name__ == '__main__':
    main()
