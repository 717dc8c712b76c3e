"""Package `paint_deposition` for ament: modules, executables and shared files."""

from collections import defaultdict
from pathlib import Path

from setuptools import find_packages, setup

PACKAGE = 'paint_deposition'
NODES = {
    'deposition_simulator': 'painting',
    'index_planner': 'planning',
    'bag_player': 'replay',
    'run_recorder': 'recording',
    'model_comparison': 'comparison',
}
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
    name=PACKAGE,
    version='0.1.0',
    packages=find_packages(include=[PACKAGE, f'{PACKAGE}.*']),
    package_data={PACKAGE: ['**/*.html', '**/*.css', '**/*.js', '**/*.j2', '**/*.yaml']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
        *shared_files(),
    ],
    install_requires=['setuptools'],
    extras_require={'test': ['pytest']},
    zip_safe=False,
    maintainer='Paint Deposition developers',
    maintainer_email='paint-deposition@example.org',
    description='Film thickness of rotary bell spray painting: simulation, calibration, diagnosis',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            f'paint = {PACKAGE}.cli.main:main',
            *(f'{node} = {PACKAGE}.nodes.{room}.{node}:main' for node, room in NODES.items()),
        ],
    },
)
