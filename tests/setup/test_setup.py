"""The set-up's scripts as a user meets them: what is missing is named, what is done stays done."""

import os
import runpy
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

COMPLETE = ('g++', 'cmake', 'make')


@pytest.fixture
def prerequisites(repository, tmp_path):
    """`prerequisites(tools, **variables)`: the check on a machine that has only these tools."""

    def run(tools, **variables):
        for tool in ('bash', 'dirname', 'readlink', 'tail', 'uname', *tools):
            (tmp_path / tool).symlink_to(shutil.which(tool))
        environment = {'PATH': str(tmp_path), 'PYTHON': sys._base_executable, **variables}
        script = repository / 'setup' / 'prerequisites.sh'
        return subprocess.run([script], env=environment, capture_output=True, text=True)

    return run


def test_complete_machine_names_its_python(prerequisites):
    done = prerequisites(COMPLETE)
    assert (done.returncode, done.stderr) == (0, '')
    assert os.path.samefile(done.stdout.strip(), sys._base_executable)


@pytest.mark.parametrize(
    ('tools', 'variables', 'said'),
    [
        (['make'], {}, ['Missing: g++, cmake.', 'sudo apt install g++ cmake']),
        (COMPLETE, {'PYTHON': '/nowhere/python3'},
         ['Python 3.10 to 3.13', 'sudo apt install python3 python3-venv python3-dev']),
        (COMPLETE, {'ROS_DISTRO': 'humble', 'ROS_VERSION': '2'}, ['Jazzy or newer']),
    ],
    ids=['tools', 'python', 'old ros'],
)  # fmt: skip
def test_what_is_missing_is_named_once_with_its_remedy(prerequisites, tools, variables, said):
    done = prerequisites(tools, **variables)
    assert done.returncode == 1
    assert [done.stderr.count(words) for words in said] == [1] * len(said), done.stderr


def test_paint_is_a_command_once_the_environment_is_sourced_and_twice_is_once(repository):
    source = '. setup/environment.sh'
    script = f'set -eu; {source}; first=$PATH; {source}; [ "$PATH" = "$first" ]; '
    script += 'command -v paint bag_player'
    done = subprocess.run(
        ['bash', '-c', script], cwd=repository, check=True, capture_output=True, text=True
    )
    folder = repository / 'ros2_ws' / 'install' / 'lib' / 'paint_deposition'
    assert done.stdout.split() == [str(folder / 'paint'), str(folder / 'bag_player')]


def test_commands_start_in_a_folder_with_spaces(repository, tmp_path):
    """What colcon writes names its interpreter in the first line, which spaces break."""
    root = tmp_path / 'paint cell 1'
    python = root / '.venv/bin/python'
    python.parent.mkdir(parents=True)
    python.symlink_to(sys.executable)
    shutil.copytree(repository / 'setup', root / 'setup')
    command = root / 'command'
    command.write_text(f'#!{python}\nimport sys\nprint(sys.argv[1:])\n')
    command.chmod(0o755)
    with pytest.raises(OSError, match='No such file'):
        subprocess.run([command])
    script = 'source "$1/setup/project.sh"; through_shell "$1/command"'
    subprocess.run(['bash', '-c', script, '-', root], check=True)
    done = subprocess.run([command, 'a b', '$c'], capture_output=True, text=True)
    assert done.stdout == "['a b', '$c']\n", done.stderr


HERE = f'"{sysconfig.get_path("include")};{sysconfig.get_path("purelib")}/numpy/_core/include"'


REPAIR = runpy.run_path(str(Path(__file__).parents[2] / 'setup/repair_cmake_exports.py'))


@pytest.mark.parametrize('elsewhere', ['/opt/python/cp311-cp311', '/home/somebody/.venv'])
def test_foreign_paths_become_ours_and_relative_ones_stay(elsewhere):
    foreign = (
        f'"{elsewhere}/include/python3.11;'
        f'{elsewhere}/lib/python3.11/site-packages/numpy/_core/include"'
    )
    relative = '"${_IMPORT_PREFIX}/include/python3.11;${_IMPORT_PREFIX}/lib/libpaint.so"'
    assert REPAIR['repaired'](foreign) == HERE
    for text in (HERE, relative):
        assert REPAIR['repaired'](text) == text
