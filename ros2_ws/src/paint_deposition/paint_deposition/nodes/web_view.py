"""Node `web_view`: the film as it is painted, on a page for browsers."""

import contextlib
import math
import os
import sys
import time
from collections import deque
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped, TransformStamped
from paint_msgs.msg import AtomizerState, ComparisonStats, Part, ThicknessField, ThicknessStats

from paint_deposition.errors import PaintError
from paint_deposition.files.recordings.messages import stamp_ns, transforms_of, trigger_change
from paint_deposition.motion.pose_stream import PoseBatch
from paint_deposition.motion.transforms import PART_POSE_TOPIC, NoTransform
from paint_deposition.nodes import topics
from paint_deposition.nodes.frames import PartFrame, TfQueue
from paint_deposition.nodes.node import OK, WARN, PaintNode, Status, Task
from paint_deposition.nodes.painting.painting_parameters import read_part
from paint_deposition.nodes.parameters import (
    DISPLAY,
    NodeParameter,
    atomizers_parameter,
    direction_parameter,
    fixed,
    mesh_parameters,
    require_display,
)
from paint_deposition.nodes.topics import AdaptiveSubscription, gun_topic
from paint_deposition.part.surface import turned
from paint_deposition.report.colour_scales import film_scale
from paint_deposition.report.live_page import DEFAULT_HOST, DEFAULT_PORT, TOKEN, Page, Scene


class WebView(PaintNode):
    """Serves the live page with what the simulator publishes; it computes no film itself.

    The part is read from its mesh, as the simulator does, and follows the simulator's `part`.
    """

    NAME = 'web_view'
    PARAMETERS = dict(DISPLAY) | dict(
        fixed(
            'the page is served with it; restart the node with the new value',
            **mesh_parameters(max_edge_length_m=0.01),
            down=direction_parameter('As for deposition_simulator [-]'),
            atomizers=atomizers_parameter('to show'),
            host=NodeParameter(
                DEFAULT_HOST,
                'Address to listen on; any but that of this machine alone needs a token, that of '
                f'{TOKEN} in the environment, or one that is made [name]',
            ),
            port=NodeParameter(
                DEFAULT_PORT, 'Port to listen on; 0: one that is free [-]', (0, 65535)
            ),
        )
    )

    def _configure(self) -> Mapping[str, Task]:
        values, results = self.values, topics.RESULTS
        names = values['atomizers'] or ['']
        self.scene = Scene()
        self._frame = PartFrame(self, values['frame_id'])
        self._flow: dict[str, float] = {}
        # The simulator, which cannot paint a pose without a transform, says why.
        self._waiting: dict[str, TfQueue] = {name: deque() for name in names}
        # Stamp of the newest figures; their time, which goes on where a stream is restarted.
        self._newest_ns, self._time_s = 0, 0.0
        self._comparison = ComparisonStats(rmse_um=math.nan)
        # What makes the film doubtful, '' if nothing does, and when the simulator said so.
        self._doubts, self._trusted_s = '', time.monotonic()
        self._problem = ''
        self._sent = 0, time.monotonic()
        self._show_part(values['mesh_file'])
        token = os.environ.get(TOKEN, '')
        self.page = Page(self.scene, values['host'], values['port'], token)
        # Not to the log, which is published.
        sys.stdout.write(f'the page is at {self.page.url}\n')
        sys.stdout.flush()
        compared = partial(setattr, self, '_comparison')
        for message, topic, take, profile in (
            (Part, topics.PART_TOPIC, self._take_part, topics.LATCHED),
            (TransformStamped, PART_POSE_TOPIC, self._take_part_pose, topics.LATCHED),
            (ThicknessField, 'thickness/field', self._take_field, results),
            (ThicknessStats, 'thickness/stats', self._take_stats, topics.LATCHED),
            (ComparisonStats, 'comparison/stats', compared, topics.LATCHED),
            (DiagnosticStatus, topics.TRUST_TOPIC, self._take_trust, topics.LATCHED),
        ):
            self.create_subscription(message, topic, take, profile)
        self._inputs = [
            AdaptiveSubscription(
                self, message, gun_topic(name, topic), partial(self._take_input, name), depth=500,
                latched=message is AtomizerState,
            )
            for name in names
            for message, topic in (
                (AtomizerState, topics.STATE_TOPIC), (PoseStamped, topics.POSE_TOPIC),
            )
        ]  # fmt: skip
        # At 1 kHz fifty poses wait at most.
        self.create_steady_timer(0.05, self._take_motion)
        self.create_steady_timer(0.5, self._show_trust)
        return {'page': self.status}

    def close(self) -> None:
        self.page.close()

    def _validate(self, values: Mapping[str, Any], changed: set[str]) -> None:
        require_display(values)

    def _on_change(self, names: set[str]) -> None:
        self._show_scale()

    # --- the part and its film

    def _show_part(self, mesh_file: str) -> None:
        surface = read_part(self.values, mesh_file)
        # The simulator may find that the guns paint its other side.
        self._mesh_file, self._mesh_ids = mesh_file, {surface.mesh_id, turned(surface).mesh_id}
        self.scene.show_part(surface)
        self.scene.tell('about', text=Path(mesh_file).name)
        self._film_um: np.ndarray = np.zeros(0, np.float32)
        self._show_scale()

    def _take_part(self, part: Part) -> None:
        self._newest_ns, self._time_s = 0, 0.0
        # A mesh that was exported anew has its old name.
        if part.mesh_file == self._mesh_file and part.mesh_id in self._mesh_ids:
            self.scene.begin_again()
        else:
            try:
                self.require_named_folder(part.mesh_file)
                self._show_part(part.mesh_file)
            except Exception as error:  # no file that a peer names ends a node
                self._say(str(error) or 'not enough memory')
                return
        serial = f'{part.serial}, ' if part.serial else ''
        self.scene.tell('about', text=serial + Path(part.mesh_file).name)

    def _take_field(self, field: ThicknessField) -> None:
        if field.mesh_id not in self._mesh_ids:
            self._say(
                f'the film that comes is not on {self._mesh_file} as it is read here; give '
                'web_view the mesh_file, mesh_scale and max_edge_length_m of the simulator'
            )
            return
        self._say('')
        self._film_um = np.asarray(field.thickness_um, np.float32)
        self._show_scale()
        self.scene.show_film(self._film_um)

    def _show_scale(self) -> None:
        values = self.values
        scale = film_scale(self._film_um, values['color_min_um'], values['color_max_um'])
        target = values['target_um'], values['target_tolerance_um']
        self.scene.show_scale(scale, values['painted_above_um'], *target)

    def _take_stats(self, stats: ThicknessStats) -> None:
        now_ns = stamp_ns(stats.header)
        if now_ns:  # there was a pose
            self._time_s += max(now_ns - (self._newest_ns or now_ns), 0) * 1e-9
            self._newest_ns = now_ns
            self.scene.add_figures(self._time_s, stats, self._comparison.rmse_um)

    def _take_trust(self, trust: DiagnosticStatus) -> None:
        self._doubts = '' if trust.level == OK else trust.message
        self._trusted_s = time.monotonic()

    def _show_trust(self) -> None:
        silent_s = time.monotonic() - self._trusted_s
        # The simulator speaks twice a second.
        silent = f'no word of the simulator for {silent_s:.0f} s' if silent_s > 2.0 else ''
        self.scene.tell('trust', doubts=silent or self._doubts)

    def _say(self, problem: str) -> None:
        """Tell what keeps the film from being shown; '' is nothing."""
        if problem and problem != self._problem:
            self.get_logger().error(problem)
        self._problem = problem
        self.scene.tell('message', text=problem)

    # --- the guns

    def _take_motion(self) -> None:
        for topic in (*self._frame.tf_topics, *self._inputs):
            topic.take_pending()
        for gun, waiting in self._waiting.items():
            for pose, placed in self._frame.placed_in_order(waiting):
                if isinstance(placed, NoTransform):
                    continue
                position_m, quaternion = placed
                stamps = np.array([stamp_ns(pose.header)])
                batch = PoseBatch(stamps, position_m[np.newaxis], quaternion[np.newaxis])
                for position, z_axis in zip(*batch.finite_axes(), strict=True):
                    # Without any state the gun is taken to spray, as the simulator does.
                    self.scene.move_gun(gun, position, z_axis, self._flow.get(gun, 1.0))

    def _take_part_pose(self, placed: TransformStamped) -> None:
        for _, parent, _, pose in transforms_of([placed]):
            self._frame.tree.place(self._frame.frame_id, parent, pose)

    def _take_input(self, gun: str, message: PoseStamped | AtomizerState, _info: Any) -> None:
        if isinstance(message, PoseStamped):
            self._waiting[gun].append((time.monotonic(), message))
            return
        with contextlib.suppress(PaintError):  # the simulator, which refuses it, says so
            self._flow[gun] = trigger_change(message).flow

    def status(self) -> Status:
        sent, now_s = self.page.bytes_sent, time.monotonic()
        rate = (sent - self._sent[0]) / max(now_s - self._sent[1], 1e-9)
        self._sent = sent, now_s
        browsers = len(self.page.browsers)
        values = {'browsers': browsers, 'sent to all of them [kB/s]': f'{rate / 1e3:.0f}'}
        if self._problem:
            return WARN, self._problem, values
        return OK, f'{browsers} browsers on {self.page.url.split("?")[0]}', values
