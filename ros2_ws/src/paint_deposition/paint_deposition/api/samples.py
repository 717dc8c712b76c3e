"""The sample parts, recordings and readings that are installed with the package."""

from pathlib import Path

from paint_deposition.errors import PaintError


def sample_folder() -> Path:
    """Folder of the samples, wherever pip or colcon put it.

    Raises:
        PaintError: the package was installed without its shared files.
    """
    package = Path(__file__).resolve().parents[1]
    places = [package.parent / 'samples']
    places += [folder / 'share' / package.name / 'samples' for folder in package.parents]
    for place in places:
        if (place / 'door.stl').is_file():
            return place
    raise PaintError(f'no samples belong to {package}; install the package with pip or colcon')
