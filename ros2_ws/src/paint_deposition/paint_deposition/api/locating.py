"""Where a part stands in the frame of the robot."""

from pathlib import Path

from paint_deposition.errors import RecordingError
from paint_deposition.files.gauge_readings import read_points
from paint_deposition.motion.part_location import PartPlace, locate


def locate_by_points(
    touched: str | Path, points: str | Path, unit: str | None = None
) -> PartPlace:
    """The pose of a part from points that the robot touched.

    Args:
        touched: table of named points in the robot's frame.
        points: table of the same points in the part's frame.
        unit: 'm', 'mm' or 'cm' where headings tell none.

    Raises:
        PaintError: the tables cannot be read, or determine no pose.
    """
    given = read_points(Path(touched), unit), read_points(Path(points), unit)
    try:
        return locate(*given)
    except RecordingError as error:
        raise RecordingError(f'{touched} and {points}: {error}') from None
