"""Hidden effects of the gun, its robot and its pump: the log is not what the gun did."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from .flight import Air, Slices
from .jobs import Motion, moved
from .parcels import Parcels
from .truths import DOWN, Scene, Truth, with_drift


class TcpOffset(Truth):
    """The true bell sits beside the logged TCP by a fixed vector in the tool frame."""

    id, family, typical, unit = 'tcp_offset', 'lateral shift', 0.004, 'm'
    most = 0.04

    @classmethod
    def details(cls, rng):
        return {'direction_rad': rng.uniform(-np.pi, np.pi)}

    def on_motion(self, motion: Motion, scene: Scene) -> Motion:
        a = self.drawn['direction_rad']
        aside = motion.turn @ np.array([np.cos(a), np.sin(a), 0.0])
        return moved(motion, tcp_m=motion.tcp_m + self.amplitude * aside)


class TcpStandoff(Truth):
    """The true bell is `amplitude` nearer to the part (along +z of the tool) than logged."""

    id, family, typical, unit, sign = 'tcp_standoff', 'standoff', 0.006, 'm', 'either'
    most = 0.05

    def on_motion(self, motion: Motion, scene: Scene) -> Motion:
        return moved(motion, tcp_m=motion.tcp_m + self.amplitude * motion.turn[:, :, 2])


class TcpTilt(Truth):
    """The true bell axis is turned about a fixed axis of the tool's x-y plane."""

    id, family, typical, unit = 'tcp_tilt', 'lateral shift', np.deg2rad(1.5), 'rad'
    most = np.deg2rad(12.0)

    @classmethod
    def details(cls, rng):
        return {'axis_rad': rng.uniform(-np.pi, np.pi)}

    def on_motion(self, motion: Motion, scene: Scene) -> Motion:
        a = self.drawn['axis_rad']
        tilt = Rotation.from_rotvec(self.amplitude * np.array([np.cos(a), np.sin(a), 0.0]))
        return moved(motion, turn=motion.turn @ tilt.as_matrix())


class PartMisalignment(Truth):
    """The door hangs elsewhere than its drawing: displaced (amplitude) and turned a little."""

    id, family, typical, unit = 'part_misalignment', 'lateral shift', 0.006, 'm'
    most = 0.05

    @classmethod
    def details(cls, rng):
        direction, axis = rng.normal(size=(2, 3))
        turn = np.deg2rad(rng.uniform(0.2, 0.8)) * axis / np.linalg.norm(axis)
        return {'direction': direction / np.linalg.norm(direction), 'turn_rad': turn}

    def on_motion(self, motion: Motion, scene: Scene) -> Motion:
        if scene.part.kind != 'door':
            return motion
        centre = np.array([0.0, 0.0, 0.5 * scene.part.height_m])
        back = Rotation.from_rotvec(-np.asarray(self.drawn['turn_rad'])).as_matrix()
        shift = self.amplitude * np.asarray(self.drawn['direction'])
        return moved(motion, (motion.tcp_m - centre - shift) @ back.T + centre, back @ motion.turn)


class PoseLag(Truth):
    """A pose is logged `amplitude` seconds after the gun was there; triggers are on time."""

    id, family, typical, unit = 'pose_lag', 'time', 0.015, 's'
    most = 0.15

    def on_motion(self, motion: Motion, scene: Scene) -> Motion:
        return replace(motion, time_s=motion.time_s - self.amplitude)


class CornerSlowdown(Truth):
    """The robot brakes toward each reversal although commanded poses were logged.

    Constant deceleration: v^2 grows linearly with the path s from the reversal over `reach_m`, so
    the dwell is (1 + a) / sqrt(1 + s/reach ((1 + a)^2 - 1)), a at the reversal and 0 at reach.
    """

    id, family, typical, unit = 'corner_slowdown', 'boundary', 0.3, '1'
    most = 2.5

    @classmethod
    def details(cls, rng):
        return {'reach_m': rng.uniform(0.22, 0.38)}

    def dwell(self, reversal_m: np.ndarray) -> np.ndarray:
        share = np.minimum(reversal_m / self.drawn['reach_m'], 1.0)
        peak = 1.0 + self.amplitude
        return peak / np.sqrt(1.0 + share * (peak**2 - 1.0))

    def on_flow(self, flow: Callable, scene: Scene) -> Callable:
        nominal = scene.nominal
        return lambda t: flow(t) * self.dwell(np.interp(t, nominal.time_s, nominal.reversal_m))


class TriggerLag(Truth):
    """The flow answers the trigger like a first-order lag: rise in `amplitude`, fall faster."""

    id, family, typical, unit = 'trigger_lag', 'boundary', 0.08, 's'
    most = 0.6

    @classmethod
    def details(cls, rng):
        return {'fall_ratio': rng.uniform(0.3, 0.8)}

    def staging(self) -> dict:
        return {'gun': 'near_edge'}

    def on_flow(self, flow: Callable, scene: Scene) -> Callable:
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

    id, family, typical, unit, sign = 'flow_drift', 'order', 0.02, '1/pass', 'either'
    most = 0.12

    def on_flow(self, flow: Callable, scene: Scene) -> Callable:
        first, last = scene.nominal.trigger_s[0], scene.nominal.trigger_s[-1]
        one_pass = (last - first) / (scene.nominal.pass_number.max() + 1)
        middle = 0.5 * (first + last)
        return lambda t: flow(t) * (1.0 + self.amplitude * (t - middle) / one_pass)


class GunWake(Truth):
    """The plume trails the moving gun: a parcel at the model plane lags by v x amplitude."""

    id, family, typical, unit = 'gun_wake', 'time', 0.020, 's'
    most = 0.15

    def on_air(self, air: Air, slices: Slices, parcels: Parcels) -> Air:
        duration = (slices.time_1_s - slices.time_0_s)[:, None]
        velocity = (slices.tcp_1_m - slices.tcp_0_m) / duration
        return with_drift(air, -self.amplitude * velocity)


class AirDrift(Truth):
    """A draught carries the parcels: small droplets more, and ever faster along their flight.

    Displacement = amplitude x mobility x s^1.5, s = share of the way from the bell to the model
    plane: entrained from rest (power 2) by a jet that slows down (power 1).
    """

    id, family, typical, unit = 'air_drift', 'lateral shift', 0.015, 'm'
    most = 0.12

    @classmethod
    def details(cls, rng):
        side = np.array([rng.choice([-1.0, 1.0]), 0.0, 0.0])
        return {'direction': DOWN.copy() if rng.random() < 0.75 else side}

    def on_air(self, air: Air, slices: Slices, parcels: Parcels) -> Air:
        return with_drift(air, self.amplitude * np.asarray(self.drawn['direction']))
