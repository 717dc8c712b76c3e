"""How node processes end: signals, errors, and what is finished before."""

import socket
import time
from contextlib import ExitStack

import domain_coordinator
import pytest

from nodes.bags.runs import NUMBERED
from nodes.cell import write_panel
from nodes.processes import NodeProcess

NODE = """
import os, signal, sys, time
from pathlib import Path
from paint_deposition.errors import PaintError
from paint_deposition.nodes.parameters import NodeParameter
from paint_deposition.nodes.node import PaintNode, run_node


class Worker(PaintNode):
    NAME = 'worker'
    PARAMETERS = {'does': NodeParameter('run', 'What it does [word]')}

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.ready = False
        if self.values['does'] == 'begin':
            os.kill(os.getpid(), signal.SIGINT)
        self.create_timer(0.02, self.work)

    def _validate(self, values, changed):
        if values['does'] == 'load at once':
            os.kill(os.getpid(), signal.SIGINT)

    def _configure(self):
        if self.values['does'] == 'refuse':
            raise PaintError('mesh none.stl does not exist; give a mesh')
        if 'load' in self.values['does']:
            print('loading', flush=True)
            while True:
                signal.pause()

    def work(self):
        if not self.ready:
            print('ready', flush=True)
        self.ready = True
        does = self.values['does']
        if does == 'fail':
            raise PaintError('the disk is full; empty it')
        if does == 'crash':
            raise ZeroDivisionError('never mind')
        if does == 'work':
            print('working', flush=True)
            time.sleep(0.5)
            Path('worked').touch()

    def close(self):
        time.sleep(0.3)
        print('closed', flush=True)


sys.exit(run_node(Worker))
"""


@pytest.fixture
def worker(ros_domain, tmp_path):
    """`worker(does)`: a process of the node above."""
    with ExitStack() as started:

        def worker(does: str) -> NodeProcess:
            process = NodeProcess(tmp_path / does, '', code=NODE, does=repr(does))
            return started.enter_context(process)

        yield worker


def complaints(process: NodeProcess) -> list[str]:
    """What a node says beside that it is ready."""
    return [line for line in process.err.strip().splitlines() if not line.endswith(': ready')]


def test_an_interrupt_ends_it_cleanly(worker, wait_until, tmp_path):
    """Between callbacks, within one, which is completed first, before it loads and meanwhile."""
    run, work, load, early = map(worker, ('run', 'work', 'load', 'load at once'))
    for process, word in ((run, 'ready'), (work, 'working'), (load, 'loading')):
        wait_until(lambda p=process, w=word: w in p.out, what=word)
        process.interrupt_as_launch_does()
        # And once more while it finishes its files.
        process.interrupt_as_launch_does()
    assert [process.wait() for process in (run, work, load, early)] == [0, 0, 0, 0]
    assert run.out.split() == ['ready', 'closed']
    assert run.err.strip().endswith('[worker]: ready')
    assert complaints(run) == []
    assert (tmp_path / 'worked').exists()
    assert work.out.split()[-1] == 'closed'
    assert load.err == early.err == early.out == ''


def test_errors_and_signals_end_it_with_a_code_and_a_line(worker, tmp_path):
    begin, refuse, fail, crash = map(worker, ('begin', 'refuse', 'fail', 'crash'))
    assert [process.wait() for process in (begin, refuse, fail, crash)] == [0, 2, 2, 1]
    # Interrupted between loading and running: the node is closed.
    assert begin.out.split()[-1] == 'closed'
    assert begin.err == ''
    assert complaints(refuse) == ['error: mesh none.stl does not exist; give a mesh']
    assert complaints(fail) == ['error: the disk is full; empty it']
    assert fail.out.split() == crash.out.split() == ['ready', 'closed']
    assert 'ZeroDivisionError: never mind' in crash.err
    with NodeProcess(tmp_path / 'bad', '', code=NODE, ros_arguments=('-p', 'does')) as process:
        assert process.wait() == 2
        assert process.err.strip().splitlines()[-1].startswith('error: ')
        assert 'Traceback' not in process.err


INTERRUPTED_IMPORT = """
import os, signal, sys
from importlib.abc import MetaPathFinder


class Interrupt(MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == {module!r}:
            os.kill(os.getpid(), signal.SIGINT)


sys.meta_path.insert(0, Interrupt())
from paint_deposition.nodes.executables import deposition_simulator
sys.exit(deposition_simulator())
"""


# Meshes other than STL are read by trimesh, which catches whatever is raised where it imports
# networkx, an interrupt too.
@pytest.mark.parametrize('module', ['rclpy', 'networkx'])
def test_one_ctrl_c_while_libraries_are_imported_ends_the_process(ros_domain, tmp_path, module):
    code = INTERRUPTED_IMPORT.format(module=module)
    mesh = write_panel(tmp_path / 'panel.obj')
    with NodeProcess(tmp_path / 'node', '', code=code, mesh_file=mesh) as process:
        assert process.wait() == 0, process.err
        assert 'Traceback' not in process.err


def test_security_without_keys_is_refused_in_a_line(ros_domain, tmp_path, monkeypatch):
    """Whether the middleware lacks the keys or the libraries for them."""
    (tmp_path / 'enclaves').mkdir()
    for name, value in (
        ('ENABLE', 'true'), ('STRATEGY', 'Enforce'), ('KEYSTORE', str(tmp_path)),
    ):  # fmt: skip
        monkeypatch.setenv(f'ROS_SECURITY_{name}', value)
    with NodeProcess(tmp_path / 'recorder', 'run_recorder', output_directory=tmp_path) as process:
        assert process.wait() == 2
        assert process.err.splitlines()[-1].startswith('error: ROS cannot make the node: ')
        assert 'Traceback' not in process.err


@pytest.mark.skipif(not NUMBERED, reason='only Fast DDS waits seconds between announcements')
def test_a_node_announces_itself_often(ros_domain, tmp_path, monkeypatch):
    """A tenth time within two seconds, not after fifteen, so that it hears a robot soon."""
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    with domain_coordinator.domain_id() as empty_domain, udp as participant:
        monkeypatch.setenv('ROS_DOMAIN_ID', str(empty_domain))
        # Where DDS announces to the fourth participant on a machine.
        participant.bind(('127.0.0.1', 7400 + 250 * empty_domain + 10 + 2 * 3))
        participant.settimeout(30.0)
        with NodeProcess(tmp_path / 'source', 'atomizer_source', trigger='/gun'):
            heard_s = [participant.recv(65536) and time.monotonic() for _ in range(10)]
    assert heard_s[-1] - heard_s[0] < 5.0
