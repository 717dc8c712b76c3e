"""Whether the film in the cell can be trusted: nothing lost, late or stale, and all recorded."""

import time
from functools import partial

from diagnostic_msgs.msg import DiagnosticStatus
from paint_msgs.msg import PoseProgress

from paint_deposition.files.recordings.headers import stamp_ns
from paint_deposition.nodes.painting.atomizer_input import (
    LONGEST_NAME,
    MOST_NAMES,
    STATES_REFUSED,
    AtomizerInput,
)
from paint_deposition.nodes.painting.painting_diagnostics import SILENT_S
from paint_deposition.nodes.painting.painting_node import PaintingNode
from paint_deposition.nodes.runtime import topics
from paint_deposition.nodes.runtime.node import OK, WARN
from paint_deposition.nodes.runtime.topics import PROGRESS_TOPIC, gun_topic, node_name

PERIOD_S = 0.5
# A recorder that reports so much older a pose, or nothing for so long, is behind.
BEHIND_NS, QUIET_S = 2_000_000_000, 3.0


class FilmTrust:
    """Publishes `thickness/trust`, latched and twice a second: the level and the reasons.

    Nodes that report the poses they have taken on `atomizer/progress`, as a recorder does, must
    not fall behind.
    """

    def __init__(self, node: PaintingNode) -> None:
        self._node = node
        # Of each gun and reporter: stamp of its newest pose, and when it said so.
        self._reports: dict[tuple[str, str], tuple[int, float]] = {}
        self._publisher = node.create_publisher(
            DiagnosticStatus, topics.TRUST_TOPIC, topics.LATCHED
        )
        for source in node.inputs:
            topic = gun_topic(source.name, PROGRESS_TOPIC)
            take = partial(self._take_report, source.name)
            node.create_subscription(PoseProgress, topic, take, topics.PROGRESS)
        node.create_steady_timer(PERIOD_S, self.publish)

    def publish(self) -> None:
        """Publish the status of the film as it is now."""
        doubts = [doubt for number in range(len(self._node.inputs)) for doubt in self._of(number)]
        if self._node.model_problem:
            doubts.append(self._node.model_problem)
        self._publisher.publish(
            DiagnosticStatus(
                level=WARN if doubts else OK, name=topics.TRUST_TOPIC,
                message='; '.join(doubts) or 'all that was sent is in the film',
                hardware_id=self._node.get_fully_qualified_name(),
            )
        )  # fmt: skip

    def _of(self, number: int) -> list[str]:
        """What is doubtful of a gun's share since the last reset."""
        source, counts = self._node.inputs[number], self._node.film.guns[number].counts
        counted = {
            'messages lost': source.messages_lost,
            'poses refused': source.poses_refused,
            'poses that are none': counts.not_finite + counts.not_unit_quaternions,
            'poses that came behind others': counts.backward_stamps,
            'late states': counts.late_triggers,
            STATES_REFUSED: source.anomalies[STATES_REFUSED],
            'poses not painted while inactive': source.unpainted,
        }
        doubts = [f'{count} {what}' for what, count in counted.items() if count]
        silent_s = time.monotonic() - source.pose_s
        if source.spraying and silent_s > SILENT_S:
            doubts.append(f'the gun sprays, and no pose has come for {silent_s:.0f} s')
        doubts += self._behind(source)
        return [f'{source.name}: {doubt}' if source.name else doubt for doubt in doubts]

    def _behind(self, source: AtomizerInput) -> list[str]:
        """Who is behind with the poses of a gun."""
        reports = {name: it for (gun, name), it in self._reports.items() if gun == source.name}
        if not reports:
            return []
        topic = self._node.resolve_topic_name(gun_topic(source.name, PROGRESS_TOPIC))
        there = {node_name(info) for info in self._node.get_publishers_info_by_topic(topic)}
        doubts = []
        for name, (newest_ns, heard_s) in reports.items():
            if name not in there:  # it has ended
                del self._reports[source.name, name]
            elif time.monotonic() - heard_s > QUIET_S:
                doubts.append(f'{name} has stalled')
            elif source.newest_ns - newest_ns > BEHIND_NS:
                doubts.append(f'{name} is {1e-9 * (source.newest_ns - newest_ns):.0f} s behind')
        return doubts

    def _take_report(self, gun: str, report: PoseProgress) -> None:
        key = gun, report.reporter[:LONGEST_NAME]
        own = report.reporter == self._node.get_fully_qualified_name()
        if not own and (key in self._reports or len(self._reports) < MOST_NAMES):
            self._reports[key] = stamp_ns(report.header), time.monotonic()
