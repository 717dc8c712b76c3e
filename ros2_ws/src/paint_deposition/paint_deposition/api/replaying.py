"""A recorded run, painted again on the live page."""

import time
from collections.abc import Sequence
from threading import Event

import numpy as np

from paint_deposition.api.simulation import look_at_guns
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.common_film import LiveFilms
from paint_deposition.film.live_film import LiveFilm, without_refused_states
from paint_deposition.film.statistics import (
    DEFAULT_PAINTED_ABOVE_UM,
    film_statistics,
    require_band,
)
from paint_deposition.motion.pose_stream import PoseBatch, events_of
from paint_deposition.motion.trajectory import DEFAULT_MAX_POSE_GAP_S, Trajectory
from paint_deposition.part.surface import Surface
from paint_deposition.report.colour_scales import film_scale
from paint_deposition.report.live_page import Scene

# The film is shown so often [s].
PERIOD_S = 0.2


class Replay:
    """Paints a recorded motion into a scene, as the simulator does a live one.

    Args:
        surface: the part; it is turned round if the gun looks at its back.
        motions: the name of each gun, and its motion in the frame of the part.
        models: of each gun.
        rate: speed relative to the recording; 0: as fast as it can be painted.
        target_um, tolerance_um: the film wanted and what it may differ [um].

    Attributes:
        scene: what is shown.
        warnings: what is odd about the motion.

    Raises:
        PaintError: as for ``simulate``.
    """

    def __init__(
        self,
        surface: Surface,
        motions: Sequence[tuple[str, Trajectory]],
        models: Sequence[DepositionModel],
        *,
        rate: float = 1.0,
        max_pose_gap_s: float = DEFAULT_MAX_POSE_GAP_S,
        target_um: float = 0.0,
        tolerance_um: float = 0.0,
    ) -> None:
        require_band(target_um, tolerance_um)
        names, recorded = zip(*motions, strict=True)
        trajectories = [without_refused_states(*gun) for gun in zip(recorded, models, strict=True)]
        seen = look_at_guns(surface, trajectories, models, max_pose_gap_s=max_pose_gap_s)
        self.warnings = tuple(
            w for gun in seen for w in (*gun.trajectory.warnings, *gun.geometry.warnings)
        )
        self._surface, self._points = seen[0].surface, seen[0].surface.points()
        self._names, self._motions, self._models, self._rate = names, trajectories, models, rate
        self._gap_s, self._target = max_pose_gap_s, (target_um, tolerance_um)
        # A stream that was restarted is painted in the order in which it was recorded.
        self._times_ns = [np.maximum.accumulate(motion.stamps_ns) for motion in trajectories]
        self._start_ns = min(int(times[0]) for times in self._times_ns)
        self._end_ns = max(int(times[-1]) for times in self._times_ns)
        # Relative flow (N,) at each pose; 1 without a trigger.
        self._flows = []
        for motion in trajectories:
            order = np.argsort(motion.trigger_stamps_ns, kind='stable')
            stamps_ns = motion.trigger_stamps_ns[order]
            passed = np.searchsorted(stamps_ns, motion.stamps_ns, side='right')
            before = 0.0 if len(order) else 1.0
            self._flows.append(np.append(before, motion.trigger_flow[order])[passed])
        self._paused, self._again = Event(), Event()
        self.scene = Scene()
        self.scene.show_part(self._surface)
        self.scene.tell('replay', paused=False)

    def command(self, name: str) -> None:
        """Do what the page asks for: 'pause', or go on; or 'again' from the start."""
        if name == 'again':
            self._again.set()
        if name == 'again' or self._paused.is_set():
            self._paused.clear()
        else:
            self._paused.set()
        self.scene.tell('replay', paused=self._paused.is_set())

    def run(self, stop: Event) -> None:
        """Paint, again whenever that is asked for, until ``stop`` is set."""
        while not stop.is_set():
            self._again.clear()
            self.paint(stop)
            while not (stop.is_set() or self._again.is_set()):
                stop.wait(PERIOD_S)

    def paint(self, stop: Event) -> None:
        """Paint once, until the end or until that is no longer wanted."""
        self.scene.begin_again()
        unpainted = []
        for motion, model in zip(self._motions, self._models, strict=True):
            film = LiveFilm(
                self._points, model, occluder=self._surface, max_pose_gap_s=self._gap_s
            )
            # It knows when the gun will be switched, as it does offline.
            film.replay(events_of(motion, until=0))
            unpainted.append(film)
        films = LiveFilms(tuple(unpainted))
        self._show(films, 0.0)
        shown_ns = now_ns = self._start_ns - 1
        began_s = time.monotonic()
        while now_ns < self._end_ns and not (stop.is_set() or self._again.is_set()):
            if self._paused.is_set():
                stop.wait(PERIOD_S)
                began_s += PERIOD_S
                continue
            if self._rate:
                stop.wait(PERIOD_S)
                elapsed_s = (time.monotonic() - began_s) * self._rate
            else:
                elapsed_s = (now_ns - self._start_ns) * 1e-9 + 1.0
            now_ns = min(self._start_ns + round(elapsed_s * 1e9), self._end_ns)
            for number, film in enumerate(films.guns):
                motion, times_ns = self._motions[number], self._times_ns[number]
                first, end = np.searchsorted(times_ns, [shown_ns, now_ns], side='right').tolist()
                film.replay(events_of(motion, first, end))
                batch = PoseBatch(motion.stamps_ns, motion.positions_m, motion.quaternions_xyzw)
                for row in range(first, end):
                    for place, z_axis in zip(*batch.select([row]).finite_axes(), strict=True):
                        name, flow = self._names[number], self._flows[number][row]
                        self.scene.move_gun(name, place, z_axis, flow)
            shown_ns = now_ns
            self._show(films, (now_ns - self._start_ns) * 1e-9)

    def _show(self, films: LiveFilms, time_s: float) -> None:
        film, (target_um, tolerance_um) = films.snapshot(), self._target
        film_um = film.film_um
        figures = film_statistics(
            film_um, self._surface.vertex_areas_m2, film.used.emitted_cm3,
            target_um=target_um, target_tolerance_um=tolerance_um,
        )  # fmt: skip
        scale = film_scale(film_um)
        self.scene.show_scale(scale, DEFAULT_PAINTED_ABOVE_UM, target_um, tolerance_um)
        self.scene.show_film(film_um)
        self.scene.add_figures(time_s, figures)
