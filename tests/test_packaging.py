"""What a build promises: manifests that agree, executables that exist, known parameters."""

import importlib
import importlib.metadata
import os
import re
import runpy
import shutil
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import paint_deposition
from paint_deposition.nodes import executables

PACKAGE = 'paint_deposition'
NODES = (
    'atomizer_source', 'bag_player', 'deposition_simulator', 'egm_source', 'index_planner',
    'model_comparison', 'opcua_source', 'run_recorder', 'rws_source', 'web_view',
)  # fmt: skip
SOURCES = Path(__file__).resolve().parent.parent / 'ros2_ws' / 'src'


def manifest(package: str) -> ElementTree.Element:
    return ElementTree.parse(SOURCES / package / 'package.xml').getroot()


def class_of(node: str) -> type:
    _, place, name = getattr(executables, node).args
    return getattr(importlib.import_module(f'{PACKAGE}.nodes.{place}'), name)


def table_of(node: str) -> dict:
    """The parameter table of the node's class, by name."""
    return class_of(node).PARAMETERS


@pytest.mark.filterwarnings('ignore::DeprecationWarning')
def test_manifests_changelogs_and_licences_agree_with_each_other_and_the_code(repository):
    """The changelogs of the packages are read as bloom reads them."""
    from catkin_pkg.changelog import get_changelog_from_path

    xml, installed = manifest(PACKAGE), importlib.metadata.metadata(PACKAGE)
    version = paint_deposition.__version__
    assert xml.findtext('name') == installed['Name'].replace('-', '_')
    assert xml.findtext('license') == installed['License']
    maintainer = xml.find('maintainer')
    assert installed['Maintainer-email'] == f'{maintainer.text} <{maintainer.get("email")}>'
    assert installed['Version'] == version
    for package in (PACKAGE, 'paint_msgs'):
        assert manifest(package).findtext('version') == version
        changelog = get_changelog_from_path(SOURCES / package)
        assert next(changelog.foreach_version())[0] == version
    assert yaml.safe_load((repository / 'CITATION.cff').read_text())['version'] == version
    released = re.findall(r'^## \[([\d.]+)\]', (repository / 'CHANGELOG.md').read_text(), re.M)
    assert released[0] == version
    licence = (repository / 'LICENSE').read_bytes()
    assert (SOURCES / PACKAGE / 'LICENSE').read_bytes() == licence
    # The manifest names every message package in use.
    used = set()
    for path in (SOURCES / PACKAGE / PACKAGE).rglob('*.py'):
        used |= set(re.findall(r'^\s*from (\w+)\.(?:msg|srv) import', path.read_text(), re.M))
    assert used <= {tag.text for tag in xml.iter('depend')}


def test_what_is_installed_is_where_ros2_looks(repository):
    from ament_index_python.packages import get_package_share_directory

    scripts = importlib.metadata.distribution(PACKAGE).entry_points
    names = {script.name for script in scripts if script.group == 'console_scripts'}
    assert names == {'paint', *NODES}
    for name in names:
        path = repository / 'ros2_ws' / 'install' / 'lib' / PACKAGE / name
        assert os.access(path, os.X_OK), name
    share = Path(get_package_share_directory(PACKAGE))
    for folder in ('launch', 'config', 'samples'):
        for source in (SOURCES / PACKAGE / folder).rglob('*'):
            if source.is_file() and '__pycache__' not in source.parts:
                installed = share / source.relative_to(SOURCES / PACKAGE)
                assert installed.read_bytes() == source.read_bytes()


LAUNCH_FILE = SOURCES / PACKAGE / 'launch' / 'paint_cell.launch.py'
LAUNCHED = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

source = PythonLaunchDescriptionSource(sys.argv[1])
arguments = [argument.split(':=') for argument in sys.argv[2:]]
service = LaunchService()
service.include_launch_description(
    LaunchDescription([IncludeLaunchDescription(source, launch_arguments=arguments)])
)
sys.exit(service.run())
"""


def wanted(**given: str) -> dict[str, dict]:
    """The nodes that the launch file starts for these arguments, with what it tells them."""
    pytest.importorskip('launch_ros', reason='launch_ros comes with a ROS installation')
    from launch import LaunchContext
    from launch.actions import DeclareLaunchArgument

    file = runpy.run_path(str(LAUNCH_FILE))
    context = LaunchContext()
    context.launch_configurations.update(given)
    for entity in file['generate_launch_description']().entities:
        if isinstance(entity, DeclareLaunchArgument):
            entity.execute(context)
    return file['node_parameters'](context.launch_configurations)


def launched(*arguments: str) -> str:
    """What `ros2 launch` says of a launch that ends with an error."""
    pytest.importorskip('launch_ros', reason='launch_ros comes with a ROS installation')
    command = [sys.executable, '-c', LAUNCHED, LAUNCH_FILE, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 1, done.stdout + done.stderr
    return done.stdout + done.stderr


def test_launch_file_describes_every_node_and_leaves_the_rest_to_a_file_of_ones_own(tmp_path):
    given = {'record': 'runs', 'measurements': 'readings.csv', 'urdf': 'arm.urdf', 'page': 'true'}
    nodes = wanted(bag='run', rate='2', publish_clock='false', **given) | wanted(**given)
    assert set(nodes) == set(NODES) - {'egm_source', 'opcua_source', 'rws_source'}
    for node, parameters in nodes.items():
        assert set(parameters) <= set(table_of(node))
    assert set(wanted()) == {'deposition_simulator', 'index_planner'}
    assert wanted(trigger='/gun')['atomizer_source'] == {'trigger': '/gun'}
    own = tmp_path / 'own.yaml'
    own.write_text('')
    nodes = wanted(parameters=str(own), bag='run', page='true')
    assert nodes.pop('bag_player') == {'bag': 'run', 'wait_for_subscribers': 2}
    assert nodes == {'deposition_simulator': {}, 'index_planner': {}, 'web_view': {}}
    # The robot of a bag is taken from the bag.
    for given, told in (
        ({'urdf': 'arm.urdf'}, {'urdf': 'arm.urdf'}),
        ({'base_frame': 'world'}, {'tf': ['world', 'tool0']}),
    ):
        nodes = wanted(bag='run', **given)
        assert 'atomizer_source' not in nodes
        assert told.items() <= nodes['bag_player'].items()
    # A replay waits for every node that takes poses.
    for given, count in (
        ({}, 1), ({'record': 'runs'}, 2), ({'measurements': "painter's.csv"}, 2),
        ({'record': '1', 'measurements': 'readings.csv', 'page': 'true'}, 4),
        ({'wait_for_subscribers': '5'}, 5),
    ):  # fmt: skip
        assert wanted(bag='run', **given)['bag_player']['wait_for_subscribers'] == count


@pytest.mark.slow
@pytest.mark.parametrize(
    ('argument', 'words'),
    [
        ('rate:=fast', "rate: 'fast' is no number"),
        ('parameters:=nowhere.yaml', 'there is no file nowhere.yaml'),
    ],
)
def test_a_launch_that_cannot_be_starts_no_node(argument, words):
    said = launched('bag:=run', argument)
    assert words in said
    assert 'process started' not in said


@pytest.mark.slow
def test_a_node_that_fails_ends_the_launch_with_an_error(ros_domain, tmp_path):
    """The bag is not there: the player fails at once, while the others still load."""
    said = launched(f'bag:={tmp_path / "run"}')
    assert 'bag_player ended with exit code 2' in said
    for process in re.findall(r'process started with pid \[(\d+)\]', said):
        assert not Path(f'/proc/{process}').exists()


def test_containers_start_nodes_with_parameters_that_there_are(repository):
    compose = yaml.safe_load((repository / 'compose.yaml').read_text())
    commands = [service['command'].split() for service in compose['services'].values()]
    assert {words[0] for words in commands} <= {*NODES, 'web_view', 'ros2'}
    for node, *words in commands:
        given = [a for option, a in pairwise(words) if option == '-p' and node in NODES]
        assert {name.split(':=')[0] for name in given} <= set(table_of(node) if given else ())
    for recipe in (repository / 'containers').glob('*.Dockerfile'):
        copied = re.findall(r'^COPY (\S+)', recipe.read_text(), re.M)
        assert all((repository / path).exists() for path in copied)


def test_the_aggregator_has_one_group_for_each_node():
    path = SOURCES / PACKAGE / 'config' / 'diagnostic_aggregator.yaml'
    groups = yaml.safe_load(path.read_text())['analyzers']['ros__parameters']
    sought = [
        word for group in groups.values() if isinstance(group, dict) for word in group['contains']
    ]
    assert sorted(sought) == [f'{node}:' for node in NODES]


@pytest.mark.parametrize('node', NODES)
def test_parameter_file_tells_of_every_parameter_and_holds_the_defaults(node):
    text = (SOURCES / PACKAGE / 'config' / 'cell.yaml').read_text()
    section = text.split(f'/**/{node}:')[1].split('/**/')[0]
    table = table_of(node)
    for name in table:
        assert re.search(rf'^ +(# )?{name}: .*#', section, re.M), f'{node}: {name} is not there'
    for name, value in yaml.safe_load(text)[f'/**/{node}']['ros__parameters'].items():
        assert (value, type(value)) == (table[name].default, type(table[name].default)), name


def test_every_dependency_is_declared_and_pinned(repository):
    """Each with the oldest release that will do; the pins satisfy them all."""
    pins = dict(
        line.split(' ')[0].split('==')
        for line in (repository / 'requirements/core.txt').read_text().splitlines()
        if '==' in line and not line.startswith('#')
    )
    chosen = {
        canonicalize_name(line.split()[0])
        for line in (repository / 'requirements/core.in').read_text().splitlines()
        if line and not line.startswith('#')
    }
    required = [
        Requirement(text) for text in importlib.metadata.requires(PACKAGE) if 'extra' not in text
    ]
    assert {canonicalize_name(requirement.name) for requirement in required} == chosen
    # Those that rosdep has as packages of the system, and the comment that names the others.
    text = (SOURCES / PACKAGE / 'package.xml').read_text().replace('ruamel.yaml', 'ruamel-yaml')
    named = {'yaml': 'pyyaml', 'lark-parser': 'lark'}
    keys = {named.get(key, key) for key in re.findall('<exec_depend>python3-(.*)</', text)}
    others = set(re.search('<!--(.*?)-->', text, re.DOTALL)[1].replace(',', '').split())
    assert keys == chosen - others
    for requirement in required:
        assert requirement.specifier
        assert requirement.specifier.contains(pins[canonicalize_name(requirement.name)]), (
            requirement
        )


@pytest.fixture
def run(repository, tmp_path_factory):
    """Runs a program of a new environment with nothing but the wheel and what it asks for."""
    folder = tmp_path_factory.mktemp('wheel')
    source = shutil.copytree(
        SOURCES / PACKAGE, folder / 'source', ignore=shutil.ignore_patterns('__pycache__', 'build')
    )
    uv = repository / '.venv/bin/uv'
    for command in (
        [uv, 'build', '--wheel', '--out-dir', folder, source],
        [uv, 'venv', '--python', sys._base_executable, folder / 'venv'],
        [uv, 'pip', 'install', '--python', folder / 'venv/bin/python',
         '--constraint', repository / 'requirements/core.txt', f'{PACKAGE} @ {{wheel}}'],
    ):  # fmt: skip
        wheel = next(folder.glob('*.whl'), None)
        command = [str(part).replace('{wheel}', f'file://{wheel}') for part in command]
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    shutil.rmtree(source)
    # With compiled code beside the modules, as in the wheels of setup/wheel.sh.
    (modules,) = folder.glob(f'venv/lib/python3*/site-packages/{PACKAGE}')
    for compiled in (SOURCES / PACKAGE / PACKAGE).rglob('*.nb[ic]'):
        target = modules / compiled.relative_to(SOURCES / PACKAGE / PACKAGE)
        target.parent.mkdir(exist_ok=True)
        shutil.copy(compiled, target)
    # The environment lies in a repository of another project, as environments do.
    subprocess.run(['git', 'init', '--quiet', folder], check=True)
    who = ['-c', 'user.name=Somebody', '-c', 'user.email=somebody@example.org']
    message = ['commit', '--quiet', '--allow-empty', '--message', 'Begin']
    subprocess.run(['git', '-C', folder, *who, *message], check=True)
    bare = {'HOME': os.environ['HOME']}

    def run(name: str, *arguments: object) -> subprocess.CompletedProcess:
        command = [folder / 'venv/bin' / name, *map(str, arguments)]
        return subprocess.run(command, cwd=folder, env=bare, capture_output=True, text=True)

    return run


AT_WORK = """
import sys
import paint_deposition as pd
from paint_deposition.cli.main import run

samples = pd.sample_folder()
print(samples, pd.read_mesh(samples / 'panel.stl'), sep='\\n')
given = ['--mesh', f'{samples}/panel.stl', '--trajectory', f'{samples}/panel_577']
simulated = run(['simulate', *given, '--max-edge-length-m', '0.1', '-o', sys.argv[1]])
sys.exit(simulated or run(['doctor']))
"""


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_the_wheel_brings_command_and_library_without_ros(run, tmp_path):
    assert run('paint', '--version').stdout == f'paint {paint_deposition.__version__}\n'
    done = run('python', '-c', AT_WORK, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    samples, surface, *_ = done.stdout.splitlines()
    assert samples.endswith('share/paint_deposition/samples')
    assert surface.startswith('Surface(')
    assert {'film.csv', 'film.ply', 'film.png', 'stats.json'} <= set(os.listdir(tmp_path))
    assert "ROS 2           ModuleNotFoundError: No module named 'rclpy'" in done.stdout
    # What it does not bring is asked for in a line: an extra, and ROS for a node.
    words = 'a sweep needs pyarrow, which is not installed; run:'
    for command, told in (
        (('paint', 'sweep', 'a', '-o', tmp_path / 'out'), f'paint: {words} pip install '),
        (('bag_player',), 'bag_player: needs rclpy; source a ROS 2 installation'),
    ):
        done = run(*command)
        assert (done.returncode, done.stdout, done.stderr.count('\n')) == (2, '', 1)
        assert done.stderr.startswith(told)
