"""Hidden effects of the gun, its robot and its pump: the log is not what the gun did."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from .truths import DOWN, Scene, Truth, between, variant, with_drift


class TcpOffset(Truth):
    """The true bell sits beside the logged TCP by a fixed vector in the tool frame."""

    id, family, typical, most, unit = 'tcp_offset', 'lateral shift', 0.004, 0.04, 'm'
    ranges = between(direction_rad=(-np.pi, np.pi))

    def on_motion(self, motion, scene):
        a = self.drawn['direction_rad']
        aside = motion.turn @ np.array([np.cos(a), np.sin(a), 0.0])
        return replace(motion, tcp_m=motion.tcp_m + self.amplitude * aside)


class TcpStandoff(Truth):
    """The true bell is `amplitude` nearer to the part (along +z of the tool) than logged."""

    id, family, typical, most, unit, sign = 'tcp_standoff', 'standoff', 0.006, 0.05, 'm', 'either'

    def on_motion(self, motion, scene):
        return replace(motion, tcp_m=motion.tcp_m + self.amplitude * motion.turn[:, :, 2])


class TcpTilt(Truth):
    """The true bell axis is turned about a fixed axis of the tool's x-y plane."""

    id, family, typical, unit = 'tcp_tilt', 'lateral shift', np.deg2rad(1.5), 'rad'
    most = np.deg2rad(12.0)
    ranges = between(axis_rad=(-np.pi, np.pi))

    def on_motion(self, motion, scene):
        a = self.drawn['axis_rad']
        tilt = Rotation.from_rotvec(self.amplitude * np.array([np.cos(a), np.sin(a), 0.0]))
        return replace(motion, turn=motion.turn @ tilt.as_matrix())


class PartMisalignment(Truth):
    """The door hangs elsewhere than its drawing: displaced (amplitude) and turned a little."""

    id, family, typical, most, unit = 'part_misalignment', 'lateral shift', 0.006, 0.05, 'm'

    @classmethod
    def details(cls, rng):
        direction, axis = rng.normal(size=(2, 3))
        turn = np.deg2rad(rng.uniform(0.2, 0.8)) * axis / np.linalg.norm(axis)
        return {'direction': direction / np.linalg.norm(direction), 'turn_rad': turn}

    def on_motion(self, motion, scene):
        if scene.part.kind != 'door':
            return motion
        height_m, shift_m, turn_rad = self.hung(scene.part)
        about, back = np.array([0.0, 0.0, height_m]), Rotation.from_rotvec(-turn_rad).as_matrix()
        tcp_m = (motion.tcp_m - about - shift_m) @ back.T + about
        return replace(motion, tcp_m=tcp_m, turn=back @ motion.turn)

    def hung(self, part):
        """Height that it is turned about, shift and turn."""
        shift_m = self.amplitude * np.asarray(self.drawn['direction'])
        return 0.5 * part.height_m, shift_m, np.asarray(self.drawn['turn_rad'])


class PoseLag(Truth):
    """A pose is logged `amplitude` seconds after the gun was there; triggers are on time."""

    id, family, typical, most, unit = 'pose_lag', 'time', 0.015, 0.15, 's'

    def on_motion(self, motion, scene):
        return replace(motion, time_s=motion.time_s - self.amplitude)


class CornerSlowdown(Truth):
    """Braking evenly toward each reversal: dwell (1 + a) / sqrt(1 + s/reach ((1 + a)^2 - 1))."""

    id, family, typical, unit = 'corner_slowdown', 'boundary', 0.3, '1'
    most, ranges = 2.5, between(reach_m=(0.22, 0.38))

    def dwell(self, reversal_m: np.ndarray) -> np.ndarray:
        return self.longer(reversal_m / self.drawn['reach_m'], 1.0 + self.amplitude)

    @staticmethod
    def longer(share: np.ndarray, peak: float) -> np.ndarray:
        return peak / np.sqrt(1.0 + np.minimum(share, 1.0) * (peak**2 - 1.0))

    def on_flow(self, flow, scene):
        nominal = scene.nominal
        return lambda t: flow(t) * self.dwell(np.interp(t, nominal.time_s, nominal.reversal_m))


def _ramp(share: np.ndarray, peak: float) -> np.ndarray:
    return 1.0 / (1.0 / peak + (1.0 - 1.0 / peak) * np.minimum(share, 1.0))


def _half_cosine(share: np.ndarray, peak: float) -> np.ndarray:
    return _ramp(0.5 * (1.0 - np.cos(np.pi * np.minimum(share, 1.0))), peak)


variant(CornerSlowdown, 'exponential', 'A servo that lags: the dwell dies away exponentially.',
        ranges=between(reach_m=(0.08, 0.18)),
        longer=lambda share, peak: 1.0 + (peak - 1.0) * np.exp(-share))  # fmt: skip
variant(CornerSlowdown, 'cosine', 'Limited jerk: half a cosine.', longer=_half_cosine)
variant(CornerSlowdown, 'ramp', 'A speed in proportion to the way.', longer=_ramp)


class TriggerLag(Truth):
    """The flow answers the trigger like a first-order lag: rise in `amplitude`, fall faster."""

    id, family, typical, most, unit = 'trigger_lag', 'boundary', 0.08, 0.6, 's'
    ranges, gun = between(fall_ratio=(0.3, 0.8)), 'near_edge'

    def on_flow(self, flow, scene):
        nominal = scene.nominal
        level = flow(nominal.trigger_s[nominal.trigger_on] + 1e-6).mean()
        starts, opens = nominal.trigger_s, nominal.trigger_on
        taus = np.where(opens, self.amplitude, self.amplitude * self.drawn['fall_ratio'])
        before = np.zeros(starts.size)
        for k in range(1, starts.size):
            fade = np.exp(-(starts[k] - starts[k - 1]) / taus[k - 1])
            before[k] = opens[k - 1] + (before[k - 1] - opens[k - 1]) * fade

        def lagged(t):
            k = np.searchsorted(starts, t, side='right') - 1
            n = np.maximum(k, 0)
            fade = np.exp(-np.maximum(t - starts[n], 0.0) / taus[n])
            return np.where(k < 0, 0.0, level * (opens[n] + (before[n] - opens[n]) * fade))

        return lagged


class FlowDrift(Truth):
    """The pump's flow drifts steadily with time, by `amplitude` of the mean per pass."""

    id, family, typical, most, unit, sign = 'flow_drift', 'order', 0.02, 0.12, '1/pass', 'either'

    def on_flow(self, flow, scene):
        first, last = scene.nominal.trigger_s[0], scene.nominal.trigger_s[-1]
        one_pass = (last - first) / (scene.nominal.pass_number.max() + 1)
        middle = 0.5 * (first + last)
        return lambda t: flow(t) * (1.0 + self.amplitude * (t - middle) / one_pass)


class GunWake(Truth):
    """The plume trails the moving gun: a parcel at the model plane lags by v x amplitude."""

    id, family, typical, unit = 'gun_wake', 'time', 0.020, 's'
    most, growth = 0.15, None

    def on_air(self, air, slices, parcels):
        duration = (slices.time_1_s - slices.time_0_s)[:, None]
        velocity = (slices.tcp_1_m - slices.tcp_0_m) / duration
        return with_drift(air, -self.amplitude * velocity, self.growth)


variant(GunWake, 'even', 'The plume is left behind at an even rate all along its way.', growth=1.0)


class AirDrift(Truth):
    """A draught carries small droplets more: amplitude x mobility x (share of the way)^1.5."""

    id, family, typical, unit = 'air_drift', 'lateral shift', 0.015, 'm'
    most, growth = 0.12, None

    @classmethod
    def details(cls, rng):
        side = np.array([rng.choice([-1.0, 1.0]), 0.0, 0.0])
        return {'direction': DOWN.copy() if rng.random() < 0.75 else side}

    def on_air(self, air, slices, parcels):
        drift_m = self.amplitude * np.asarray(self.drawn['direction'])
        return with_drift(air, drift_m, self.growth)


variant(AirDrift, 'square', 'Droplets that are still fast: the square of the way.', growth=2.0)
variant(AirDrift, 'carried', "Droplets at the draught's own speed: the way itself.", growth=1.0)


class TiltBentBracket(TcpTilt):
    """A bent bracket turns the bell about a pivot behind it, so that it moves aside as well."""

    form = 'bent_bracket'
    ranges = TcpTilt.ranges | between(pivot_m=(0.03, 0.12))

    def on_motion(self, motion, scene):
        tilted = super().on_motion(motion, scene)
        aside = self.drawn['pivot_m'] * (tilted.turn[:, :, 2] - motion.turn[:, :, 2])
        return replace(tilted, tcp_m=tilted.tcp_m + aside)


class MisalignmentSwing(PartMisalignment):
    """The door hangs on its upper edge and swings out: `amplitude` at the lower edge."""

    form = 'swing'

    @classmethod
    def details(cls, rng):
        return {'side': rng.choice([-1.0, 1.0])}

    def hung(self, part):
        angle = self.drawn['side'] * self.amplitude / part.height_m
        return part.height_m, 0.0, np.array([angle, 0.0, 0.0])


class TriggerDelay(TriggerLag):
    """A valve with a dead time: the flow follows the trigger late, and at once."""

    form = 'delay'

    def on_flow(self, flow, scene):
        motion = scene.nominal
        late = self.amplitude * np.where(motion.trigger_on, 1.0, self.drawn['fall_ratio'])
        level = flow(motion.trigger_s[motion.trigger_on] + 1e-6).mean()
        delayed = replace(motion, trigger_s=np.maximum.accumulate(motion.trigger_s + late))
        return lambda t: level * delayed.commanded(t)


class FlowSettling(FlowDrift):
    """A pump that settles after the start: exponential, `amplitude` per pass on the average."""

    form = 'settling'
    ranges = between(share=(0.15, 0.5))

    def on_flow(self, flow, scene):
        first, passes, length = _spraying(scene)
        tau = self.drawn['share'] * length
        whole = self.amplitude * (passes - 1) / (1.0 - np.exp(-length / tau))
        return lambda t: flow(t) * (1.0 - whole * (np.exp(-np.maximum(t - first, 0) / tau) - 0.5))


class FlowStep(FlowDrift):
    """A regulator that jumps once while the part is painted."""

    form = 'step'
    ranges = between(at=(0.3, 0.7))

    def on_flow(self, flow, scene):
        first, passes, length = _spraying(scene)
        at, half = first + self.drawn['at'] * length, 0.35 * self.amplitude * (passes - 1)
        return lambda t: flow(t) * (1.0 + half * np.tanh((t - at) / (0.03 * length)))


class FlowByPass(FlowDrift):
    """A dosing cylinder that is set anew before each pass: the same flow all along the pass."""

    form = 'by_pass'

    def on_flow(self, flow, scene):
        starts = scene.nominal.trigger_s[scene.nominal.trigger_on]
        middle = 0.5 * (starts.size - 1)

        def drifting(t):
            number = np.maximum(np.searchsorted(starts, t, side='right') - 1, 0)
            return flow(t) * (1.0 + self.amplitude * (number - middle))

        return drifting


class DriftByHeight(AirDrift):
    """A downdraught that gathers speed toward the exhaust in the floor."""

    form = 'by_height'

    @classmethod
    def details(cls, rng):
        return {'direction': DOWN.copy(), 'gain_per_m': rng.uniform(0.4, 1.2)}

    def on_air(self, air, slices, parcels):
        here = 1.0 + self.drawn['gain_per_m'] * (0.45 - slices.tcp_0_m[:, 2:])
        down = np.asarray(self.drawn['direction'])
        return with_drift(air, self.amplitude * np.maximum(here, 0.1) * down)


def _spraying(scene: Scene) -> tuple[float, int, float]:
    """(first trigger, passes, time from it to the last)."""
    first, last = scene.nominal.trigger_s[0], scene.nominal.trigger_s[-1]
    return first, int(scene.nominal.pass_number.max()) + 1, last - first
