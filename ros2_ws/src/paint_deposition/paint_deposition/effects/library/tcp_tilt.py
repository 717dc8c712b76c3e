"""A bell axis that is not the tool's z axis."""

import scipy

from paint_deposition.effects.base import Effect, PathContext, SprayPath, parameter


class TcpTilt(Effect):
    """The bell's axis is turned against the recorded tool, about an axis through the TCP.

    Acts on the motion: every tool frame turns by the rotation vector (tilt_x, tilt_y, 0) in the
    tool's own axes, right-handed. Positive tilt about x moves the spot to -y of the tool by
    standoff x tan(tilt), positive tilt about y moves it to +x.
    """

    id = 'tcp_tilt'
    family = 'lateral shift'
    exact = True
    signature = 'pattern shifted as by an offset, and one flank heavier than the other'
    rivals = ('air_drift', 'tcp_offset', 'part_misalignment', 'sag')
    source = 'error of tool calibration; size from general practice'

    tilt_x_rad: float = parameter(
        0.0, low=-0.2, high=0.2, typical=0.026, unit='rad',
        description='turn of the bell about the tool\'s x; positive moves the spot to -y',
    )  # fmt: skip
    tilt_y_rad: float = parameter(
        0.0, low=-0.2, high=0.2, typical=0.026, unit='rad',
        description='turn of the bell about the tool\'s y; positive moves the spot to +x',
    )  # fmt: skip

    def on_path(self, path: SprayPath, context: PathContext) -> SprayPath:
        turn = [self.tilt_x_rad, self.tilt_y_rad, 0.0]
        tilt = scipy.spatial.transform.Rotation.from_rotvec(turn)
        return path.with_(rotation=path.rotation @ tilt.as_matrix())
