"""A cell of nodes for random steps: what was sent for each run, and how the run is compared."""

import itertools
import time
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from hypothesis.stateful import RuleBasedStateMachine
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from paint_msgs.msg import AtomizerState, PoseProgress
from std_srvs.srv import Trigger

from brushes import NARROW, WIDE, two_brushes
from nodes.cell import Onlooker, Robot, free_port, offline_um, parameters, write_panel
from nodes.processes import NodeProcess
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.files.model_file import write_model
from paint_deposition.files.motion_files import read_recording
from paint_deposition.files.recordings.bags import STATE_TOPIC
from paint_deposition.film.live_film import without_refused_states
from paint_deposition.model.eq1_pattern import Brush
from paint_deposition.nodes.egm_source import EgmSource
from paint_deposition.nodes.painting.deposition_simulator import DepositionSimulator
from paint_deposition.nodes.web_view import WebView

BRUSHES = {1, 2}
SIMULATOR, RECORDER = '/deposition_simulator', '/run_recorder'


class Simulator(DepositionSimulator):
    """Keeps the film of the part that leaves, and of one that is reset."""

    left: SimpleNamespace | None = None

    def keep(self) -> None:
        self.left = SimpleNamespace(
            points=self.points, surface=self.surface, film=self.film.snapshot().film_um,
            models=self.models, received=self.film.counts.received,
            late_states=self.film.counts.late_triggers,
            refused=self.inputs[0].refused_frames.total(),
        )  # fmt: skip

    def change_part(self, *part) -> None:
        self.keep()
        super().change_part(*part)

    def reset(self) -> Trigger.Response:
        self.catch_up()
        self.keep()
        self.catch_up = lambda: None  # what comes from here on is of the next run
        try:
            return super().reset()
        finally:
            del self.catch_up


class NodesOfACell(RuleBasedStateMachine):
    """Simulator, page, robot and recorder, and what was sent for the part in the cell."""

    numbers = itertools.count()

    def __init__(self, context, executor, wait_until, folder: Path) -> None:
        super().__init__()
        self.context, self.executor, self.wait_until = context, executor, wait_until
        self.folder = folder / f'cell_{next(self.numbers)}'
        self.folder.mkdir()
        self.recorders, self.serials = itertools.count(), itertools.count(1)
        self.clients: dict[str, object] = {}
        self.reports: Counter[str] = Counter()
        self.active, self.frame, self.sent, self.painted_before = True, 'part', 0, 0
        # Stamps of the poses that were sent for the part in the cell, but for those refused.
        self.of_part: list[int] = []
        self.stamp_ns = self.gun_ns = time.time_ns() + 3_600_000_000_000
        self.told_ns = 0  # when the last state was sent, at the earliest
        self.run, self.is_whole, self.weak, self.recorder = '', False, None, None

    def tell(self, state: AtomizerState) -> None:
        """Send a state of the gun."""
        self.told_ns = time.time_ns()
        self.robot.state_publisher.publish(state)

    def make_nodes(self) -> None:
        def made(kind, **values):
            return kind(context=self.context, parameter_overrides=parameters(**values))

        panels = self.folder / 'a.stl', self.folder / 'b.stl'
        self.meshes = [
            str(write_panel(path, scale=by)) for path, by in zip(panels, (1.0, 1.3), strict=True)
        ]
        exchanged = zip(BRUSHES, (WIDE, NARROW), strict=True)
        brushes = (Brush(number=number, planar=planar) for number, planar in exchanged)
        self.models = [str(self.folder / f'{name}.yaml') for name in 'ab']
        write_model(self.models[0], two_brushes())
        write_model(self.models[1], DepositionModel(brushes=brushes))
        panel = {'mesh_file': self.meshes[0], 'max_edge_length_m': 0.1}
        self.simulator = made(
            Simulator, **panel, model_file=self.models[0], part_parent_frame='cell',
            output_directory=str(self.folder / 'films'),
        )  # fmt: skip
        self.robot, self.operator = Robot(self.context, latched=True), Onlooker(self.context)
        self.operator.create_subscription(PoseProgress, 'atomizer/progress', self.count, 100)
        self.page, self.port = made(WebView, **panel, port=0), free_port()
        self.egm = made(EgmSource, address='127.0.0.1', port=self.port)
        self.nodes = [self.simulator, self.robot, self.operator, self.page, self.egm]
        for node in self.nodes:
            self.executor.add_node(node)

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
        chosen = {'output_directory': self.folder / 'runs', 'name': name}
        self.recorder = NodeProcess(self.folder / name, 'run_recorder', **chosen)
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
        wanted = Transition(label=label)
        assert self.call(ChangeState, f'{node}/change_state', transition=wanted).success

    def settle(self) -> None:
        """All that was sent is painted, and the gun is as it was told."""
        if self.active:
            self.wait_until(lambda: self.painted == self.sent, what='all painted')
        (gun,) = self.simulator.inputs
        self.wait_until(lambda: gun.state_sent_ns >= self.told_ns, what='the last state')
        self.simulator.catch_up()

    @property
    def painted(self) -> int:
        refused = self.simulator.inputs[0].refused_frames.total()
        return self.simulator.film.counts.received + refused + self.painted_before

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
        # A clock that was set back a little makes states late: live they switch what is not
        # painted yet, in the recording all poses of their time.
        if of.late_states:
            return
        taken = without_refused_states(motion, of.models[0])
        offline = offline_um(of, taken, of.models[0])
        assert np.array_equal(offline, of.film), (run, np.abs(offline - of.film).max())

    def leave(self, next_run: str, earliest: int) -> None:
        """The part has left with at least so many poses: compare, and go on with the next run."""
        left = self.simulator.left
        assert left.received >= earliest, (left.received, earliest)
        self.painted_before += left.received + left.refused
        left.stamps_ns = self.of_part[: left.received]
        self.of_part = self.of_part[left.received :]
        if self.is_whole:
            self.check(self.folder / 'runs' / self.run, left)
        self.run, self.is_whole = next_run, True
        self.wait_until((self.folder / 'runs' / self.run).is_dir, what=self.run)
