"""Fixtures that every test may use: shared data, a DDS domain of its own, nodes that spin."""

import os
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

import hypothesis
import pytest

from waiting import until

# As the command does, before NumPy is loaded: see cli/main.py.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
# Two threads on any machine: enough to see whether they change the film, and not so many that
# tests on several cores get in each other's way.
os.environ.setdefault('NUMBA_NUM_THREADS', '2')

REPOSITORY = Path(__file__).resolve().parent.parent
SHARED_DATA = REPOSITORY.parent / 'shared' / 'data'
# The wheel comes early: meanwhile the first worker compiles what all others find on the disk.
LONGEST = (
    'bench', 'test_packaging.py', 'cli', 'nature', 'inference', 'nodes', 'batch',
    'test_public.py', 'report', 'planning', 'effects',
)  # fmt: skip

# Nodes need ROS and the messages of the built workspace; the rest of the tests does without.
HAS_NODES = find_spec('rclpy') is not None and find_spec('paint_msgs') is not None
collect_ignore_glob = [] if HAS_NODES else ['nodes/*', 'test_security.py']

# The same examples on every run, and no deadline: the first call of a kernel compiles it.
hypothesis.settings.register_profile('project', deadline=None, derandomize=True)
hypothesis.settings.load_profile('project')


def pytest_report_header() -> str:
    """Why tests of nodes are left out."""
    return '' if HAS_NODES else (
        'tests of nodes are left out: rclpy or paint_msgs is missing; run `make build`, and '
        'source setup/environment.sh'
    )  # fmt: skip


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests with nodes are slow: nodes find one another, wait and shut down in real time.

    Rooms whose files take longest come first, so that no core waits for the other in the end.
    """
    for item in items:
        if 'ros_domain' in item.fixturenames:
            item.add_marker('slow')
    first = {room: place for place, room in enumerate(LONGEST)}
    tests = REPOSITORY / 'tests'
    items.sort(key=lambda item: first.get(item.path.relative_to(tests).parts[0], len(first)))


@pytest.fixture(scope='session')
def repository() -> Path:
    return REPOSITORY


@pytest.fixture(scope='session')
def sample(repository: Path) -> object:
    """The sample campaign: a panel and a door, painted by the virtual paint shop and measured."""
    from paint_deposition.files.campaign_file import read_campaign

    return read_campaign(
        repository / 'ros2_ws/src/paint_deposition/samples/measured_door/campaign.yaml'
    )


@pytest.fixture(scope='session')
def shared_data() -> Path:
    """Folder of real recordings and measurements kept beside the repository."""
    if not SHARED_DATA.is_dir():
        pytest.skip(f'recordings and measurements kept beside the repository: no {SHARED_DATA}')
    return SHARED_DATA


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures are composed and written blank: drawing them costs more than most commands.

    For tests that do not look at them. Those of fixtures of a wider scope are drawn.
    """
    from matplotlib.figure import Figure

    save = Figure.savefig
    monkeypatch.setattr(Figure, 'savefig', lambda _, *to, **how: save(Figure((1, 1)), *to, **how))


@pytest.fixture(scope='session')
def ros_domain() -> Iterator[int]:
    """A ROS domain no other test run on this machine uses; child processes inherit it."""
    domain_coordinator = pytest.importorskip('domain_coordinator')
    with domain_coordinator.domain_id() as domain, pytest.MonkeyPatch.context() as environment:
        environment.setenv('ROS_DOMAIN_ID', str(domain))
        environment.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
        yield domain


@pytest.fixture
def ros_context(ros_domain: int) -> Iterator[object]:
    """An initialised rclpy context for this test alone; pass it to nodes as `context`."""
    import rclpy
    from rclpy.context import Context

    context = Context()
    rclpy.init(context=context, domain_id=ros_domain)
    yield context
    context.try_shutdown()


@pytest.fixture
def executor(ros_context: object) -> Iterator[object]:
    """What runs the callbacks of this test's nodes, which it destroys at the end."""
    from rclpy.executors import SingleThreadedExecutor

    executor = SingleThreadedExecutor(context=ros_context)
    yield executor
    nodes = executor.get_nodes()
    executor.shutdown()
    for node in nodes:
        node.destroy_node()


@pytest.fixture
def spin(executor: object) -> Callable[..., None]:
    """`spin(node, ...)`: let `wait_until` run the callbacks of these nodes."""

    def spin(*nodes: object) -> None:
        for node in nodes:
            executor.add_node(node)

    return spin


@pytest.fixture
def wait_until(executor: object) -> Callable[..., None]:
    """`wait_until(condition, what='...')`: run callbacks until it holds.

    Fails the test when it does not hold within a minute, which is long even on a machine that is
    busy with other work. The condition is looked at after every callback and at least every
    20 ms, so it may also watch other processes and files.
    """

    def wait_until(
        condition: Callable[[], object], what: str = 'the condition', timeout_s: float = 60.0
    ) -> None:
        until(condition, what, lambda: executor.spin_once(timeout_sec=0.02), timeout_s)

    return wait_until
