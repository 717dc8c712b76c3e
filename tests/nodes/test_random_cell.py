"""Whatever happens in a cell, each recorded run has the film that was seen, to the bit.

Simulator, page, robot and recorder are nodes over DDS, the recorder in a process of its own, which
is also stopped and killed. Messages are odd, clocks are set, publishers come with another quality
of service, strangers send datagrams. After each step every node lives and counts add up; the film
of each run is that of its recording, which holds what was sent for its part. `make cell` takes
10,000 steps; PAINT_STEPS says how many here, PAINT_SEED which.
"""

import os
import socket
import time

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from hypothesis import HealthCheck, Phase, seed, settings, stateful
from hypothesis import strategies as st
from hypothesis.stateful import initialize, invariant, precondition, rule
from paint_msgs.msg import AtomizerState
from paint_msgs.srv import ChangePart
from rcl_interfaces.srv import SetParameters
from std_srvs.srv import Trigger

from nodes.cell import FACING_PANEL, Robot, parameters
from nodes.random_cell import RECORDER, SIMULATOR, NodesOfACell
from paint_deposition.files.recordings.mcap_recovery import recover
from paint_deposition.motion.transforms import Rigid
from paint_deposition.nodes.topics import header

STEPS = int(os.environ.get('PAINT_STEPS', '30'))
SEED = os.environ.get('PAINT_SEED')
STEPS_OF_A_CELL = min(60, STEPS)
STEP_NS = 4_000_000
SPEED_M_PER_S = 0.8
# A killed recorder loses what came in the last half second; it reports five times a second.
WRITTEN_REPORTS = 5
POSES = {False: [], True: [0.1, 0.0, 0.05, 0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]}
counts = st.integers(0, 80)


class Cell(NodesOfACell):
    """A robot paints parts that change, as an operator and an integrator would let it."""

    @initialize()
    def begin(self) -> None:
        self.make_nodes()
        self.start_recorder()
        self.change_part(0, 0, 0, False)
        self.state(1.0, 1, 0)

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
        self.tell(AtomizerState(header=header('', self.gun_ns), spraying=flow > 0.0, flow=flow,
                                brush=brush))  # fmt: skip

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
        {'sec': -1}, {'sec': 0}, {'flow': -1.0}, {'flow': 1e300}, {'brush': -7},
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
        self.tell(state)

    @rule(step_s=st.sampled_from([-3600.0, -2.0, -0.4, 0.1, 2.0, 3600.0]))
    def set_clock(self, step_s: float) -> None:
        """Of the robot, with the gun as it is or told anew."""
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
        if self.recorder:
            assert self.recorder.poll() is None, self.recorder.err
            assert not any(node.finished.done() for node in (self.simulator, self.page, self.egm))
            assert not self.egm.stream.sender

    def poses_meanwhile(self, count: int, asked) -> None:
        """While poses come, if the node is active, it does what it was asked for."""
        if self.active:
            self.poses(count, False)
        self.wait_until(asked.done, what='the answer')

    @rule(mesh=st.integers(0, 1), before=counts, after=counts, placed=st.booleans(),
          stalls=st.integers(0, 7))  # fmt: skip
    def change_part(
        self, mesh: int, before: int, after: int, placed: bool, stalls: int = 0
    ) -> None:
        """The recorder may be stopped meanwhile."""
        if stalls == 1:
            self.recorder.stall()
        serial, placed = str(next(self.serials)), placed or self.frame == 'cell'
        part = {'serial': serial, 'mesh_file': self.meshes[mesh], 'part_pose': POSES[placed]}
        if self.active:
            self.poses(before, False)
        # The robot says from then on where it is in the cell.
        moves = placed and self.frame == 'part'
        if moves:
            self.settle()
        if stalls == 1:
            until_s = time.monotonic() + 1.0
            self.wait_until(lambda: time.monotonic() > until_s)
        # Those sent from here on may be of either part.
        earliest = len(self.of_part)
        asked = self.ask(ChangePart, f'{SIMULATOR}/change_part', **part)
        if moves:
            self.wait_until(asked.done)
            self.frame = 'cell'
        self.poses_meanwhile(after, asked)
        if stalls == 1:
            self.recorder.go_on()
        assert asked.result().success, asked.result().message
        self.leave(serial, earliest)

    @rule(before=counts, after=counts)
    def reset(self, before: int, after: int) -> None:
        self.settle()
        if self.active:
            self.poses(before, False)
        earliest = len(self.of_part)
        self.poses_meanwhile(after, self.ask(Trigger, f'{SIMULATOR}/reset'))
        left = self.simulator.left
        if left.received:
            self.leave(self.simulator.parts.part.run, earliest)
        else:
            assert not earliest
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
        (sent,) = (change.to_parameter_msg() for change in parameters(**{name: value}))
        answer = self.call(SetParameters, f'{SIMULATOR}/set_parameters', parameters=[sent])
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
            run = recover(run, run.with_name(f'{run.name}_recovered'))[0].folder
        if self.is_whole:
            self.check(run, of)
        self.wait_until(lambda: not self.robot.hearers()[1])
        self.clients = {name: c for name, c in self.clients.items() if RECORDER not in name}
        self.start_recorder()

    def teardown(self) -> None:
        if self.recorder is None:
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
    factory = factory if SEED is None else seed(int(SEED))(factory)
    stateful.run_state_machine_as_test(factory, settings=many)
