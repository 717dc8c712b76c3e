"""A part that does not hang where its drawing says."""

import scipy

from paint_deposition.effects.base import Effect, PathContext, SprayPath, parameter


class PartMisalignment(Effect):
    """The fixture holds the part aside, too deep, or turned; the robot does not know.

    Acts on the motion: what the gun does is seen from the displaced part, so every pose moves by
    the opposite displacement. Positive ``shift_down_m``: the part hangs too low, along its own
    slope; positive ``shift_across_m``: too far to the right as the gun sees it; positive
    ``shift_deep_m``: too far from the gun, along its mean normal; positive ``yaw_rad``: turned
    anticlockwise as the gun sees it, about its mean normal through its centre.
    """

    id = 'part_misalignment'
    family = 'lateral shift'
    exact = True
    covariates = ('height_fraction',)
    signature = 'pattern shifted in a direction fixed in the part, more so away from its centre'
    rivals = ('air_drift', 'tcp_offset', 'tcp_tilt', 'sag', 'tcp_standoff')
    source = 'error of fixtures; size from general practice'

    shift_down_m: float = parameter(
        0.0, low=-0.05, high=0.05, typical=0.005, unit='m',
        description='displacement of the part; positive down along it',
    )  # fmt: skip
    shift_across_m: float = parameter(
        0.0, low=-0.05, high=0.05, typical=0.005, unit='m',
        description='displacement of the part; positive to the right seen by the gun',
    )  # fmt: skip
    shift_deep_m: float = parameter(
        0.0, low=-0.05, high=0.05, typical=0.005, unit='m',
        description='displacement of the part; positive away from the gun',
    )  # fmt: skip
    yaw_rad: float = parameter(
        0.0, low=-0.1, high=0.1, typical=0.01, unit='rad',
        description='turn about its mean normal; positive anticlockwise seen by the gun',
    )  # fmt: skip

    def on_path(self, path: SprayPath, context: PathContext) -> SprayPath:
        shift = self.shift_down_m * context.downhill + self.shift_across_m * context.across
        shift -= self.shift_deep_m * context.outward
        turn = scipy.spatial.transform.Rotation.from_rotvec(-self.yaw_rad * context.outward)
        back = turn.as_matrix()
        from_centre = path.position_m - context.centre_m - shift
        return path.with_(
            position_m=from_centre @ back.T + context.centre_m,
            rotation=back @ path.rotation,
            velocity_m_per_s=path.velocity_m_per_s @ back.T,
        )
