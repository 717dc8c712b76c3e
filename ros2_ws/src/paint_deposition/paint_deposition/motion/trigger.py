"""The trigger: what a cell's report of its atomizer means for the flow."""

import math

from paint_deposition.errors import RecordingError


def relative_flow(spraying: bool, flow: float = math.nan) -> float:
    """Flow relative to the calibrated one, 0 while the gun is off.

    Args:
        spraying: whether paint leaves the atomizer.
        flow: measured flow relative to the calibrated one; NaN is unknown and taken as 1.

    Raises:
        RecordingError: the flow is negative or infinite.
    """
    if not spraying:
        return 0.0
    if math.isnan(flow):
        return 1.0
    if flow < 0.0 or math.isinf(flow):
        raise RecordingError(f'atomizer flow is {flow}: give 1 for the calibrated flow, or NaN')
    return float(flow)
