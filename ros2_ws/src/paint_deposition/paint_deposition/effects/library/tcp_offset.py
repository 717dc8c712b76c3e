"""A TCP calibrated to the side of the bell's centre."""

from paint_deposition.effects.base import Effect, PathContext, SprayPath, parameter


class TcpOffset(Effect):
    """The bell's centre lies beside the recorded TCP, by a vector fixed in the tool.

    Acts on the motion: every TCP moves by the offsets along the tool's x and y. Positive: the
    pattern lands further along that axis than recorded.
    """

    id = 'tcp_offset'
    family = 'lateral shift'
    exact = True
    signature = 'pattern shifted in a direction fixed in the tool; turning the gun turns it'
    rivals = ('air_drift', 'tcp_tilt', 'part_misalignment', 'sag')
    source = 'error of tool calibration; size from general practice'

    offset_x_m: float = parameter(
        0.0, low=-0.05, high=0.05, typical=0.004, unit='m',
        description='true bell beside the recorded TCP; positive along the tool\'s x',
    )  # fmt: skip
    offset_y_m: float = parameter(
        0.0, low=-0.05, high=0.05, typical=0.004, unit='m',
        description='true bell beside the recorded TCP; positive along the tool\'s y',
    )  # fmt: skip

    def on_path(self, path: SprayPath, context: PathContext) -> SprayPath:
        x_axis, y_axis = path.rotation[:, :, 0], path.rotation[:, :, 1]
        offset = self.offset_x_m * x_axis + self.offset_y_m * y_axis
        return path.with_(position_m=path.position_m + offset)
