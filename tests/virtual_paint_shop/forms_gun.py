"""Other laws of the effects of gun, robot, pump and booth air: alike in kind, not in form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from .flight import Air, Slices
from .jobs import Motion, moved
from .parcels import Parcels
from .truths import DOWN, Scene, with_drift
from .truths_gun import (
    AirDrift,
    CornerSlowdown,
    FlowDrift,
    GunWake,
    PartMisalignment,
    TcpTilt,
    TriggerLag,
)


class TiltBentBracket(TcpTilt):
    """A bent bracket turns the bell about a pivot behind it, so that it moves aside as well."""

    form = 'bent_bracket'

    @classmethod
    def details(cls, rng):
        return {**super().details(rng), 'pivot_m': rng.uniform(0.03, 0.12)}

    def on_motion(self, motion: Motion, scene: Scene) -> Motion:
        tilted = super().on_motion(motion, scene)
        aside = self.drawn['pivot_m'] * (tilted.turn[:, :, 2] - motion.turn[:, :, 2])
        return moved(tilted, tcp_m=tilted.tcp_m + aside)


class MisalignmentSwing(PartMisalignment):
    """The door hangs on its upper edge and swings out: `amplitude` at the lower edge."""

    form = 'swing'

    @classmethod
    def details(cls, rng):
        return {'side': rng.choice([-1.0, 1.0])}

    def on_motion(self, motion: Motion, scene: Scene) -> Motion:
        part = scene.part
        if part.kind != 'door':
            return motion
        hanger = np.array([0.0, 0.0, part.height_m])
        angle = self.drawn['side'] * self.amplitude / part.height_m
        back = Rotation.from_rotvec([-angle, 0.0, 0.0]).as_matrix()
        return moved(motion, (motion.tcp_m - hanger) @ back.T + hanger, back @ motion.turn)


class CornerExponential(CornerSlowdown):
    """A servo that lags: the dwell dies away like a relaxation."""

    form = 'exponential'

    @classmethod
    def details(cls, rng):
        return {'reach_m': rng.uniform(0.08, 0.18)}

    def dwell(self, reversal_m):
        return 1.0 + self.amplitude * np.exp(-reversal_m / self.drawn['reach_m'])


class CornerCosine(CornerSlowdown):
    """A ramp with limited jerk: the speed follows half a cosine."""

    form = 'cosine'

    def dwell(self, reversal_m):
        share = np.minimum(reversal_m / self.drawn['reach_m'], 1.0)
        slowest = 1.0 / (1.0 + self.amplitude)
        return 1.0 / (slowest + (1.0 - slowest) * 0.5 * (1.0 - np.cos(np.pi * share)))


class CornerRamp(CornerSlowdown):
    """A path override that lets the speed grow in proportion to the way."""

    form = 'ramp'

    def dwell(self, reversal_m):
        share = np.minimum(reversal_m / self.drawn['reach_m'], 1.0)
        slowest = 1.0 / (1.0 + self.amplitude)
        return 1.0 / (slowest + (1.0 - slowest) * share)


class TriggerDelay(TriggerLag):
    """A valve with a dead time: the flow follows the trigger late, and at once."""

    form = 'delay'

    def on_flow(self, flow: Callable, scene: Scene) -> Callable:
        motion = scene.nominal
        late = self.amplitude * np.where(motion.trigger_on, 1.0, self.drawn['fall_ratio'])
        level = flow(motion.trigger_s[motion.trigger_on] + 1e-6).mean()
        delayed = replace(motion, trigger_s=np.maximum.accumulate(motion.trigger_s + late))
        return lambda t: level * delayed.commanded(t)


class FlowSettling(FlowDrift):
    """A pump that settles after the start: exponential, `amplitude` per pass on the average."""

    form = 'settling'

    @classmethod
    def details(cls, rng):
        return {'share': rng.uniform(0.15, 0.5)}

    def on_flow(self, flow: Callable, scene: Scene) -> Callable:
        first, passes, length = _spraying(scene)
        tau = self.drawn['share'] * length
        whole = self.amplitude * (passes - 1) / (1.0 - np.exp(-length / tau))
        return lambda t: flow(t) * (1.0 - whole * (np.exp(-np.maximum(t - first, 0) / tau) - 0.5))


class FlowStep(FlowDrift):
    """A regulator that jumps once while the part is painted."""

    form = 'step'

    @classmethod
    def details(cls, rng):
        return {'at': rng.uniform(0.3, 0.7)}

    def on_flow(self, flow: Callable, scene: Scene) -> Callable:
        first, passes, length = _spraying(scene)
        at, half = first + self.drawn['at'] * length, 0.35 * self.amplitude * (passes - 1)
        return lambda t: flow(t) * (1.0 + half * np.tanh((t - at) / (0.03 * length)))


class FlowByPass(FlowDrift):
    """A dosing cylinder that is set anew before each pass: the same flow all along the pass."""

    form = 'by_pass'

    def on_flow(self, flow: Callable, scene: Scene) -> Callable:
        starts = scene.nominal.trigger_s[scene.nominal.trigger_on]
        middle = 0.5 * (starts.size - 1)

        def drifting(t):
            number = np.maximum(np.searchsorted(starts, t, side='right') - 1, 0)
            return flow(t) * (1.0 + self.amplitude * (number - middle))

        return drifting


class WakeAtOnce(GunWake):
    """The plume is left behind at an even rate all along its way."""

    form = 'even'

    def on_air(self, air: Air, slices: Slices, parcels: Parcels) -> Air:
        return replace(super().on_air(air, slices, parcels), growth=1.0)


class DriftEntrained(AirDrift):
    """Droplets still fast: a steady draught displaces them with the square of the way."""

    form = 'square'

    def on_air(self, air: Air, slices: Slices, parcels: Parcels) -> Air:
        return replace(super().on_air(air, slices, parcels), growth=2.0)


class DriftCarried(AirDrift):
    """Droplets at the draught's own speed: displaced in proportion to the way."""

    form = 'carried'

    def on_air(self, air: Air, slices: Slices, parcels: Parcels) -> Air:
        return replace(super().on_air(air, slices, parcels), growth=1.0)


class DriftByHeight(AirDrift):
    """A downdraught that gathers speed toward the exhaust in the floor."""

    form = 'by_height'

    @classmethod
    def details(cls, rng):
        return {'direction': DOWN.copy(), 'gain_per_m': rng.uniform(0.4, 1.2)}

    def on_air(self, air: Air, slices: Slices, parcels: Parcels) -> Air:
        here = 1.0 + self.drawn['gain_per_m'] * (0.45 - slices.tcp_0_m[:, 2:])
        down = np.asarray(self.drawn['direction'])
        return with_drift(air, self.amplitude * np.maximum(here, 0.1) * down)


def _spraying(scene: Scene) -> tuple[float, int, float]:
    """(first trigger, passes, time from it to the last)."""
    first, last = scene.nominal.trigger_s[0], scene.nominal.trigger_s[-1]
    return first, int(scene.nominal.pass_number.max()) + 1, last - first
