"""Whatever happens in a cell, each recorded run has the film that was seen, to the bit.

Simulator, page, robot and recorder are nodes over DDS, the recorder in a process of its own, which
is also stopped and killed. Messages are odd, clocks are set, publishers come with another quality
of service, strangers send datagrams. After each step every node lives and counts add up; the film
of each run is that of its recording, which holds what was sent for its part. `make cell` takes
10,000 steps; PAINT_STEPS says how many here, PAINT_SEED which.
"""

import itertools
import os
import socket
import time
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from geometry_msgs.msg import PoseStamped
from hypothesis import HealthCheck, Phase, seed, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)
from lifecycle_msgs.srv import ChangeState
from paint_msgs.msg import AtomizerState, PoseProgress
from paint_msgs.srv import ChangePart
from rcl_interfaces.srv import SetParameters
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_srvs.srv import Trigger

from brushes import NARROW, WIDE, two_brushes
from nodes.cell import FACING_PANEL, Onlooker, Robot, offline_um, parameters, write_panel
from nodes.processes import NodeProcess
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.files.meshes import read_mesh
from paint_deposition.files.model_file import write_model
from paint_deposition.files.motion_files import read_recording
from paint_deposition.files.recordings.bags import STATE_TOPIC
from paint_deposition.files.recordings.mcap_recovery import recover
from paint_deposition.film.live_film import without_refused_states
from paint_deposition.model.eq1_pattern import Brush
from paint_deposition.motion.transforms import Rigid
from paint_deposition.nodes.egm_source import EgmSource
from paint_deposition.nodes.painting.deposition_simulator import DepositionSimulator
from paint_deposition.nodes.topics import header
from paint_deposition.nodes.web_view import WebView

STEPS = int(os.environ.get('PAINT_STEPS', '30'))
SEED = os.environ.get('PAINT_SEED')
STEPS_OF_A_CELL = min(60, STEPS)
STEP_NS = 4_000_000
SPEED_M_PER_S = 0.8
# A killed recorder loses what came in the last half second; it reports five times a second.
WRITTEN_REPORTS = 5
POSES = {False: [], True: [0.1, 0.0, 0.05, 0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]}
BRUSHES = {1, 2}
SIMULATOR, RECORDER = '/deposition_simulator', '/run_recorder'
counts = st.integers(0, 80)


class Simulator(DepositionSimulator):
    """Keeps the film of the part that leaves, and of one that is reset."""

    left: SimpleNamespace | None = None

    def keep(self) -> None:
        self.left = SimpleNamespace(
            points=self.points, surface=self.surface, film=self.film.snapshot().film_um,
            models=self.models, received=self.film.counts.received,
            refused=self.inputs[0].poses_refused,
        )  # fmt: skip

    def change_part(self, *part) -> None:
        self.keep()
        super().change_part(*part)

    def reset(self) -> tuple[bool, str]:
        self.catch_up()
        self.keep()
        self.catch_up = lambda: None  # what comes from here on is of the next run
        try:
            return super().reset()
        finally:
            del self.catch_up


class Cell(RuleBasedStateMachine):
    """A robot paints parts that change, as an operator and an integrator would let it."""

    numbers = itertools.count()

    def __init__(self, context, executor, wait_until, folder: Path) -> None:
        super().__init__()
        self.context, self.executor, self.wait_until = context, executor, wait_until
        self.folder = folder / f'cell_{next(self.numbers)}'
        self.folder.mkdir()
        self.recorders, self.serials = itertools.count(), itertools.count(1)
        self.clients: dict[str, object] = {}

    # --- the cell

    @initialize()
    def begin(self) -> None:
        narrow, wide = write_panel(self.folder / 'a.stl'), self.folder / 'b.stl'
        mesh = read_mesh(narrow)
        trimesh.Trimesh(1.3 * mesh.vertices_m, mesh.faces).export(wide)
        self.meshes = [str(narrow), str(wide)]
        models = (
            two_brushes(),
            DepositionModel(
                brushes=[
                    Brush(number=n, planar=p) for n, p in zip(BRUSHES, (WIDE, NARROW), strict=True)
                ]
            ),
        )
        self.models = [str(self.folder / f'{name}.yaml') for name in 'ab']
        for path, model in zip(self.models, models, strict=True):
            write_model(path, model)
        chosen = {
            'mesh_file': self.meshes[0], 'max_edge_length_m': 0.1, 'model_file': self.models[0],
            'output_directory': str(self.folder / 'films'), 'part_parent_frame': 'cell',
        }  # fmt: skip
        self.simulator = Simulator(context=self.context, parameter_overrides=parameters(**chosen))
        self.robot, self.operator = Robot(self.context), Onlooker(self.context, {})
        self.reports: Counter[str] = Counter()
        self.operator.create_subscription(PoseProgress, 'atomizer/progress', self.count, 100)
        latched = QoSProfile(depth=20, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.robot.destroy_publisher(self.robot.state_publisher)
        self.robot.state_publisher = self.robot.create_publisher(
            AtomizerState, 'atomizer/state', latched
        )
        shown = {name: chosen[name] for name in ('mesh_file', 'max_edge_length_m')} | {'port': 0}
        self.page = WebView(context=self.context, parameter_overrides=parameters(**shown))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(('127.0.0.1', 0))
            self.port = free.getsockname()[1]
        egm = parameters(address='127.0.0.1', port=self.port)
        self.egm = EgmSource(context=self.context, parameter_overrides=egm)
        self.nodes = [self.simulator, self.robot, self.operator, self.page, self.egm]
        for node in self.nodes:
            self.executor.add_node(node)
        self.active, self.frame, self.sent, self.weak = True, 'part', 0, None
        # Stamps of the poses that were sent for the part in the cell, but for those refused.
        self.of_part: list[int] = []
        self.stamp_ns = self.gun_ns = time.time_ns() + 3_600_000_000_000
        self.run, self.is_whole = '', False
        self.start_recorder()
        self.change_part(0, 0, 0, False)
        self.robot.send_state(self.stamp_ns, 1.0, 1)

    def count(self, report: PoseProgress) -> None:
        """Reports, and the poses that the recorder has."""
        self.reports[report.reporter] += 1
        if report.reporter == RECORDER:
            self.recorded = report.poses_received

    @staticmethod
    def is_heard(robot: Robot) -> bool:
        """By the simulator, the page and the recorder."""
        if not robot.has_subscribers(3):  # which takes no time
            return False
        here, elsewhere = robot.hearers()
        return here >= 2 and elsewhere >= 1

    def start_recorder(self) -> None:
        """Its first run is of a part that is there already."""
        name = f'run_{next(self.recorders)}'
        log = self.folder / name
        self.recorder = NodeProcess(
            log, 'run_recorder', output_directory=self.folder / 'runs', name=name
        )
        self.wait_until(lambda: self.is_heard(self.robot), what='the recorder')
        self.run, self.is_whole = name, False
        self.recorded, self.sent_before_recorder = 0, self.sent

    def call(self, service, name: str, **fields):
        future = self.ask(service, name, **fields)
        self.wait_until(future.done, what=f'the answer of {name}')
        return future.result()

    def ask(self, service, name: str, **fields):
        if name not in self.clients:
            self.clients[name] = self.operator.create_client(service, name)
        self.wait_until(self.clients[name].service_is_ready, what=name)
        return self.clients[name].call_async(service.Request(**fields))

    def transition(self, node: str, label: str) -> None:
        request = ChangeState.Request()
        request.transition.label = label
        answer = self.call(ChangeState, f'{node}/change_state', transition=request.transition)
        assert answer.success

    def settle(self) -> None:
        """All that was sent is painted."""
        if self.active:
            self.wait_until(lambda: self.painted == self.sent, what='all painted')
        self.simulator.catch_up()

    @property
    def painted(self) -> int:
        counted = self.simulator.film.counts.received + self.simulator.inputs[0].poses_refused
        return counted + self.painted_before

    painted_before = 0

    def check(self, run: Path, of: SimpleNamespace) -> None:
        """Compare the film of a run with that which the simulator had of it."""
        self.wait_until((run / 'metadata.yaml').is_file, what=f'the end of {run}')
        if len(set(of.stamps_ns)) < 2:  # no motion: nothing is painted, and nothing is read
            assert not of.film.any()
            return
        motion = read_recording(run, state_topic=STATE_TOPIC)
        assert motion.stamps_ns.tolist() == of.stamps_ns, run
        assert len(motion) == of.received, run
        if not motion.brushes & BRUSHES:  # since the clock was set back no state has come
            assert not of.film.any()
            return
        taken = without_refused_states(motion, of.models[0])
        offline = offline_um(of, taken, of.models[0])
        assert np.array_equal(offline, of.film), (run, np.abs(offline - of.film).max())

    def leave(self, next_run: str) -> None:
        """The part has left: compare, and go on with the next run."""
        left = self.simulator.left
        self.painted_before += left.received + left.refused
        left.stamps_ns, self.of_part = self.of_left, self.of_part[len(self.of_left) :]
        if self.is_whole:
            self.check(self.folder / 'runs' / self.run, self.simulator.left)
        self.run, self.is_whole = next_run, True
        self.wait_until((self.folder / 'runs' / self.run).is_dir, what=self.run)

    # --- what happens

    @precondition(lambda self: self.active)
    @rule(count=counts, wait=st.booleans())
    def poses(self, count: int, wait: bool) -> None:
        """Back and forth, each time at another height."""
        for _ in range(count):
            travelled_m = self.sent * STEP_NS * 1e-9 * SPEED_M_PER_S
            turn, along = divmod(travelled_m, 1.0)
            across = along - 0.5 if turn % 2 else 0.5 - along
            place = np.array([across, -0.25, 0.3 * np.sin(turn)])
            turned = FACING_PANEL
            if self.frame == 'cell':
                place, turned = Rigid.of(POSES[True]).applied(place, turned)
            self.robot.send_pose(self.stamp_ns, place, turned, self.frame)
            self.of_part.append(self.stamp_ns)
            self.stamp_ns += STEP_NS
            self.sent += 1
        if wait:
            self.settle()

    @rule(flow=st.sampled_from([0.0, 0.5, 1.0]), brush=st.sampled_from([1, 2]),
          ahead_ms=st.sampled_from([0, 1, 50, 300]))  # fmt: skip
    def state(self, flow: float, brush: int, ahead_ms: int) -> None:
        self.gun_ns = max(self.gun_ns, self.stamp_ns + ahead_ms * 1_000_000)
        self.robot.send_state(self.gun_ns, flow, brush)

    @precondition(lambda self: self.active)
    @rule(odd=st.sampled_from([
        {'stamp': -1}, {'stamp': 'again'}, {'value': np.nan}, {'value': np.inf}, {'value': 1e300},
        {'turned': 0.0}, {'frame': 'nowhere'}, {'frame': ''},
    ]))  # fmt: skip
    def odd_pose(self, odd: dict[str, object]) -> None:
        """What a driver sends now and then, and no robot does."""
        pose = PoseStamped()
        stamp_ns = self.stamp_ns - (STEP_NS if odd.get('stamp') == 'again' else 0)
        pose.header = header(odd.get('frame', self.frame), stamp_ns)
        if odd.get('stamp') == -1:
            pose.header.stamp.sec, stamp_ns = -1, 0
        pose.pose.position.x = float(odd.get('value', 0.1))
        pose.pose.position.y = -0.25
        turned = FACING_PANEL * odd.get('turned', 1.0)
        q = pose.pose.orientation
        q.x, q.y, q.z, q.w = turned.tolist()
        self.robot.pose_publisher.publish(pose)
        self.sent += 1
        if odd.get('frame') != 'nowhere':
            self.of_part.append(stamp_ns)
            self.stamp_ns += STEP_NS

    @rule(odd=st.sampled_from([
        {'sec': -1}, {'sec': 0}, {'flow': -1.0}, {'flow': np.inf}, {'brush': -7},
        {'flow': np.nan, 'brush': 1}, {'voltage_kv': np.nan, 'flow': 0.5, 'brush': 2},
        {'flow': 0.5, 'brush': 9},
    ]))  # fmt: skip
    def odd_state(self, odd: dict[str, float]) -> None:
        fields = {name: value for name, value in odd.items() if name != 'sec'}
        self.gun_ns = max(self.gun_ns, self.stamp_ns)
        state = AtomizerState(spraying=True, **fields)
        state.header = header('', self.gun_ns)
        if 'sec' in odd:
            state.header.stamp.sec, state.header.stamp.nanosec = odd['sec'], 0
        self.robot.state_publisher.publish(state)

    @rule(step_s=st.sampled_from([-3600.0, -2.0, -0.4, 0.1, 2.0, 3600.0]))
    def set_clock(self, step_s: float) -> None:
        """Of the robot, with the gun as it is or told anew."""
        self.settle()
        self.stamp_ns += round(step_s * 1e9)
        self.gun_ns = self.stamp_ns

    @rule(datagrams=st.lists(st.binary(max_size=80), max_size=5))
    def strangers(self, datagrams: list[bytes]) -> None:
        """Datagrams of others on the port of the robot."""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            for datagram in datagrams:
                stranger.sendto(datagram, ('127.0.0.1', self.port))

    @rule()
    def another_quality_of_service(self) -> None:
        """A best-effort publisher comes, or goes again."""
        if self.weak is None:
            self.settle()
            self.weak = Robot(self.context, reliable=False)
            self.executor.add_node(self.weak)
            self.wait_until(lambda: self.is_heard(self.weak), what='best effort')
        else:
            self.executor.remove_node(self.weak)
            self.weak.destroy_node()
            self.weak = None
            self.settle()
            self.wait_until(lambda: self.is_heard(self.robot), what='reliable ones')

    @invariant()
    def every_node_lives(self) -> None:
        if hasattr(self, 'recorder'):
            assert self.recorder.exit_code is None, self.recorder.err
            assert not any(node.finished.done() for node in (self.simulator, self.page, self.egm))
            assert not self.egm.stream.sender

    @rule(mesh=st.integers(0, 1), before=counts, after=counts, placed=st.booleans(),
          stalls=st.integers(0, 7))  # fmt: skip
    def change_part(
        self, mesh: int, before: int, after: int, placed: bool, stalls: int = 0
    ) -> None:
        """While poses come, if the node is active; the recorder may be stopped meanwhile."""
        if stalls == 1:
            self.recorder.stall()
        serial, placed = str(next(self.serials)), placed or self.frame == 'cell'
        request = {
            'serial': serial, 'mesh_file': self.meshes[mesh], 'part_pose': POSES[placed],
        }  # fmt: skip
        if self.active:
            self.poses(before, False)
        if placed and self.frame == 'part':
            # The robot says from now on where it is in the cell.
            self.settle()
        if stalls == 1:
            until_s = time.monotonic() + 1.0
            self.wait_until(lambda: time.monotonic() > until_s)
        # Those sent from here on may be of either part.
        earliest = len(self.of_part)
        asked = self.ask(ChangePart, f'{SIMULATOR}/change_part', **request)
        if placed and self.frame == 'part':
            self.wait_until(asked.done)
            self.frame = 'cell'
        if self.active:
            self.poses(after, False)
        self.wait_until(asked.done, what='the change')
        if stalls == 1:
            self.recorder.go_on()
        assert asked.result().success, asked.result().message
        left = self.simulator.left
        self.of_left = self.of_part[: left.received]
        assert left.received >= earliest, (left.received, earliest)
        self.leave(serial)

    @rule(before=counts, after=counts)
    def reset(self, before: int, after: int) -> None:
        """While poses come, if the node is active."""
        self.settle()
        if self.active:
            self.poses(before, False)
        earliest = len(self.of_part)
        asked = self.ask(Trigger, f'{SIMULATOR}/reset')
        if self.active:
            self.poses(after, False)
        self.wait_until(asked.done, what='the reset')
        left = self.simulator.left
        self.of_left = self.of_part[: left.received]
        assert left.received >= earliest, (left.received, earliest)
        if left.received:
            self.leave(self.simulator.parts.part.run)
        else:
            self.painted_before += left.refused

    @rule()
    def pause(self) -> None:
        """Deactivate the simulator, or activate it again."""
        self.settle()
        self.transition(SIMULATOR, 'deactivate' if self.active else 'activate')
        self.active = not self.active

    @rule(change=st.sampled_from([
        ('publish_rate_hz', 5.0), ('publish_rate_hz', 25.0), ('trigger_latency_s', 0.05),
        ('trigger_latency_s', 0.2), ('color_max_um', 20.0), ('model_file', 0), ('model_file', 1),
    ]))  # fmt: skip
    def set_parameter(self, change: tuple[str, object]) -> None:
        name, value = change
        value = self.models[value] if name == 'model_file' else value
        sent = [change.to_parameter_msg() for change in parameters(**{name: value})]
        answer = self.call(SetParameters, f'{SIMULATOR}/set_parameters', parameters=sent)
        assert answer.results[0].successful, answer.results[0].reason
        if name == 'model_file':
            self.wait_until(lambda: not self.simulator.repainting, what='the new model')
            assert not self.simulator.model_problem

    @rule(signal=st.sampled_from(['kill', 'terminate', 'stop', 'cycle']), each=st.integers(0, 3))
    def end_recorder(self, signal: str, each: int) -> None:
        """Kill it and recover its run, or end it as it should be, and start another."""
        if each:  # seldom: a process takes seconds to start
            return
        self.settle()
        self.simulator.keep()
        run, of = self.folder / 'runs' / self.run, self.simulator.left
        of.stamps_ns = self.of_part
        # What was sent is with the recorder, and in its file: while no poses come, it reports by
        # the clock alone.
        sent = self.sent - self.sent_before_recorder
        self.wait_until(lambda: self.recorded == sent, what='all recorded')
        so_far = self.reports[RECORDER]
        self.wait_until(lambda: self.reports[RECORDER] >= so_far + WRITTEN_REPORTS, what='reports')
        if signal == 'cycle':
            for label in ('deactivate', 'activate'):
                self.transition(RECORDER, label)
                if label == 'deactivate':
                    self.wait_until(lambda: not self.robot.hearers()[1])
            if self.is_whole:
                self.check(run, of)
            self.wait_until(lambda: self.is_heard(self.robot))
            self.is_whole = False
            return
        if signal == 'stop':
            assert self.call(Trigger, f'{RECORDER}/stop').success
        else:
            getattr(self.recorder, signal)()
        code = self.recorder.wait()
        assert code == (-9 if signal == 'kill' else 0), self.recorder.err
        assert 'Traceback' not in self.recorder.err
        # Before its first part it may have received nothing, of which nothing is recovered.
        if signal == 'kill' and self.is_whole:
            run = recover(run, run.with_name(f'{run.name}_recovered')).folder
        if self.is_whole:
            self.check(run, of)
        self.wait_until(lambda: not self.robot.hearers()[1])
        self.clients = {name: c for name, c in self.clients.items() if RECORDER not in name}
        self.start_recorder()

    def teardown(self) -> None:
        if not hasattr(self, 'recorder'):
            return
        try:
            self.settle()
            self.simulator.keep()
            self.simulator.left.stamps_ns = self.of_part
            self.recorder.terminate()
            assert self.recorder.wait() == 0, self.recorder.err
            if self.is_whole:
                self.check(self.folder / 'runs' / self.run, self.simulator.left)
        finally:
            self.recorder.__exit__()
            self.page.close()
            for node in (*self.nodes, *filter(None, [self.weak])):
                self.executor.remove_node(node)
                node.destroy_node()


@pytest.mark.timeout(0 if STEPS > 1000 else 600)
def test_every_run_has_the_film_that_was_seen(ros_context, executor, wait_until, tmp_path):
    many = settings(
        # The first example takes the same step all the time.
        max_examples=1 + max(1, STEPS // STEPS_OF_A_CELL), stateful_step_count=STEPS_OF_A_CELL,
        phases=[Phase.explicit, Phase.generate], suppress_health_check=list(HealthCheck),
        derandomize=STEPS <= 1000 and SEED is None, database=None, print_blob=True,
    )  # fmt: skip
    factory = lambda: Cell(ros_context, executor, wait_until, tmp_path)  # noqa: E731
    run_state_machine_as_test(factory if SEED is None else seed(int(SEED))(factory), settings=many)
