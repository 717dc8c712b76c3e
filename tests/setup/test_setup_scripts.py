"""The set-up's scripts as a user meets them: what is missing is named, what is done stays done."""

import os
import shutil
import subprocess
import sys

import pytest

NEEDED_BY_SCRIPTS = ('bash', 'dirname', 'readlink', 'tail', 'uname')


@pytest.fixture
def prerequisites(repository, tmp_path):
    """`prerequisites(tools, **variables)`: the check on a machine that has only these tools."""

    def run(tools, **variables):
        for tool in (*NEEDED_BY_SCRIPTS, *tools):
            (tmp_path / tool).symlink_to(shutil.which(tool))
        environment = {'PATH': str(tmp_path), 'PYTHON': sys._base_executable, **variables}
        script = repository / 'setup' / 'prerequisites.sh'
        return subprocess.run([script], env=environment, capture_output=True, text=True)

    return run


def test_complete_machine_names_its_python(prerequisites):
    done = prerequisites(['g++', 'cmake', 'make'])
    assert (done.returncode, done.stderr) == (0, '')
    assert os.path.samefile(done.stdout.strip(), sys._base_executable)


def test_everything_missing_is_named_with_one_line(prerequisites):
    done = prerequisites(['make'])
    assert done.returncode == 1
    assert 'Missing: g++, cmake.' in done.stderr
    assert done.stderr.count('sudo apt install g++ cmake') == 1


def test_missing_python_is_named(prerequisites):
    done = prerequisites(['g++', 'cmake', 'make'], PYTHON='/nowhere/python3')
    assert done.returncode == 1
    assert 'Python 3.10 to 3.13' in done.stderr
    assert 'sudo apt install python3 python3-venv python3-dev' in done.stderr


def test_old_ros_is_refused(prerequisites):
    done = prerequisites(['g++', 'cmake', 'make'], ROS_DISTRO='humble', ROS_VERSION='2')
    assert done.returncode == 1
    assert 'Jazzy or newer' in done.stderr


def test_environment_can_be_sourced_twice(repository):
    source = '. setup/environment.sh'
    script = f'set -eu; {source}; first=$PATH; {source}; [ "$PATH" = "$first" ]'
    subprocess.run(['bash', '-c', script], cwd=repository, check=True)


def test_paint_is_a_command_once_the_environment_is_sourced(repository):
    script = '. setup/environment.sh; command -v paint bag_player'
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
