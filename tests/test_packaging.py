"""What a build promises: manifests that agree, executables that exist, known parameters."""

from __future__ import annotations

import importlib
import importlib.metadata
import importlib.util
import os
import py_compile
import re
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

PACKAGE = 'paint_deposition'
NODES = ('bag_player', 'deposition_simulator', 'index_planner', 'model_comparison', 'run_recorder')
SOURCES = Path(__file__).resolve().parent.parent / 'ros2_ws' / 'src'


def manifest(package: str) -> ElementTree.Element:
    return ElementTree.parse(SOURCES / package / 'package.xml').getroot()


def words(text: str) -> str:
    return ' '.join(text.split())


def console_scripts() -> dict[str, importlib.metadata.EntryPoint]:
    scripts = importlib.metadata.distribution(PACKAGE).entry_points
    return {script.name: script for script in scripts if script.group == 'console_scripts'}


def table_of(node: str) -> dict:
    """The parameter table of the node's class, by name."""
    module = importlib.import_module(console_scripts()[node].module)
    (table,) = (
        thing.PARAMETERS
        for thing in vars(module).values()
        if isinstance(thing, type) and thing.__module__ == module.__name__
        and hasattr(thing, 'PARAMETERS')
    )  # fmt: skip
    return {row.name: row for row in table}


def cell_parameters() -> dict[str, dict]:
    """The shipped parameter file: node -> name -> value."""
    path = SOURCES / PACKAGE / 'config' / 'cell.yaml'
    nodes = yaml.safe_load(path.read_text())
    return {key.removeprefix('/**/'): body['ros__parameters'] for key, body in nodes.items()}


def test_manifest_and_setup_agree():
    xml = manifest(PACKAGE)
    installed = importlib.metadata.metadata(PACKAGE)
    assert xml.findtext('name') == installed['Name'].replace('-', '_')
    assert xml.findtext('version') == installed['Version']
    assert xml.findtext('license') == installed['License']
    assert xml.findtext('maintainer') == installed['Maintainer']
    assert xml.find('maintainer').get('email') == installed['Maintainer-email']


@pytest.mark.parametrize('package', ['paint_msgs', PACKAGE])
def test_manifests_are_complete(package, repository):
    xml = manifest(package)
    assert xml.get('format') == '3'
    assert xml.findtext('version') == manifest(PACKAGE).findtext('version')
    assert xml.findtext('license') == 'Apache-2.0'
    assert 'Apache License' in (repository / 'LICENSE').read_text()
    assert len(words(xml.findtext('description'))) > 50


def test_manifest_names_every_message_package_in_use():
    used = set()
    for path in (SOURCES / PACKAGE / PACKAGE).rglob('*.py'):
        used |= set(re.findall(r'^\s*from (\w+)\.(?:msg|srv) import', path.read_text(), re.M))
    declared = {tag.text for tag in manifest(PACKAGE).iter('depend')}
    assert used <= declared


def test_every_interface_is_built_and_listed():
    listing = (SOURCES / 'paint_msgs' / 'CMakeLists.txt').read_text()
    for kind in ('msg', 'srv'):
        built = importlib.import_module(f'paint_msgs.{kind}')
        for path in (SOURCES / 'paint_msgs' / kind).iterdir():
            assert f'{kind}/{path.name}' in listing
            assert hasattr(built, path.stem)


def test_every_field_of_a_message_has_a_comment():
    for path in (SOURCES / 'paint_msgs').glob('*/*.[ms][sr][gv]'):
        for line in path.read_text().splitlines():
            if line and not line.startswith(('#', '---', 'std_msgs/Header')):
                assert '#' in line, f'{path.name}: {line}'


def test_console_scripts_are_the_nodes_and_paint():
    assert set(console_scripts()) == {'paint', *NODES}


@pytest.mark.parametrize('name', ['paint', *NODES])
def test_console_script_has_its_function(name):
    assert callable(console_scripts()[name].load())


@pytest.mark.parametrize('name', ['paint', *NODES])
def test_executables_lie_where_ros2_run_looks(name, repository):
    path = repository / 'ros2_ws' / 'install' / 'lib' / PACKAGE / name
    assert os.access(path, os.X_OK)


def test_shared_files_are_installed():
    from ament_index_python.packages import get_package_share_directory

    share = Path(get_package_share_directory(PACKAGE))
    for folder in ('launch', 'config', 'samples'):
        for source in (SOURCES / PACKAGE / folder).rglob('*'):
            if source.is_file() and '__pycache__' not in source.parts:
                installed = share / source.relative_to(SOURCES / PACKAGE)
                assert installed.read_bytes() == source.read_bytes()


def test_launch_file_compiles(tmp_path):
    source = SOURCES / PACKAGE / 'launch' / 'paint_cell.launch.py'
    py_compile.compile(source, cfile=tmp_path / 'compiled.pyc', doraise=True)


def launch_description():
    """What the launch file describes; needs a ROS installation."""
    pytest.importorskip('launch_ros', reason='launch_ros comes with a ROS installation')
    source = SOURCES / PACKAGE / 'launch' / 'paint_cell.launch.py'
    spec = importlib.util.spec_from_file_location('paint_cell', source)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.generate_launch_description()


def test_launch_file_describes_every_node():
    entities = launch_description().entities
    executables = {e.node_executable for e in entities if hasattr(e, 'node_executable')}
    assert executables == set(NODES)


@pytest.mark.parametrize(
    ('given', 'count'),
    [
        ({}, '1'),
        ({'record': 'runs'}, '2'),
        ({'measurements': "painter's.csv"}, '2'),
        ({'record': '1', 'measurements': 'readings.csv'}, '3'),
        ({'wait_for_subscribers': '5'}, '5'),
    ],
)
def test_launched_replay_waits_for_every_node_that_takes_poses(given, count):
    description = launch_description()
    from launch import LaunchContext
    from launch.actions import DeclareLaunchArgument

    context = LaunchContext()
    context.launch_configurations.update(given)
    for entity in description.entities:
        if isinstance(entity, DeclareLaunchArgument):
            entity.execute(context)
    assert context.launch_configurations['wait_for_subscribers'] == count


def test_parameter_file_names_every_node():
    assert set(cell_parameters()) == set(NODES)


@pytest.mark.parametrize('node', NODES)
def test_parameter_file_holds_the_defaults(node):
    table = table_of(node)
    for name, value in cell_parameters()[node].items():
        assert name in table, f'{node} has no parameter {name}'
        row = table[name]
        assert type(value) is type(row.default), f'{name}: {value!r}'
        assert value == row.default, f'{name}: the node says {row.default!r}'


@pytest.mark.parametrize('node', NODES)
def test_parameter_file_tells_of_every_parameter(node):
    text = (SOURCES / PACKAGE / 'config' / 'cell.yaml').read_text()
    section = text.split(f'/**/{node}:')[1].split('/**/')[0]
    for name in table_of(node):
        assert re.search(rf'^ +(# )?{name}: .*#', section, re.M), f'{node}: {name} is not there'


def test_paint_runs_from_anywhere(repository, tmp_path):
    link = tmp_path / 'paint'
    link.symlink_to(repository / 'paint')
    done = subprocess.run(
        [link, '--help'], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=True
    )
    assert 'simulate' in done.stdout
