"""What ament needs beside pyproject.toml: the files shared with other packages and with users."""

from collections import defaultdict
from pathlib import Path

from setuptools import setup

PACKAGE = 'paint_deposition'
SHARED_FOLDERS = ('launch', 'config', 'samples')


def shared_files():
    """Files below SHARED_FOLDERS as setuptools data_files, the folders kept as they are."""
    by_folder = defaultdict(list)
    for top in SHARED_FOLDERS:
        for path in sorted(Path(top).rglob('*')):
            if path.is_file() and '__pycache__' not in path.parts:
                by_folder[f'share/{PACKAGE}/{path.parent}'].append(str(path))
    return sorted(by_folder.items())


setup(
    # Not in pyproject.toml: releases of setuptools disagree on the form of the licence there, and
    # colcon cannot read `requires-python`.
    license='Apache-2.0',
    python_requires='>=3.10',
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        # colcon builds in a folder of links to setup.py, setup.cfg, the modules and the files
        # named here: without pyproject.toml the package would have no name there.
        (f'share/{PACKAGE}', ['package.xml', 'pyproject.toml']),
        *shared_files(),
    ],
)
