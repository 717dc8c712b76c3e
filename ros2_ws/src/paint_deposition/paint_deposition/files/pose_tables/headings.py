"""Which column of a table of poses holds what, and in which unit, by its heading."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from paint_deposition.errors import RecordingError

# Names of a heading, as `name_and_unit` leaves them, for each quantity.
# The letter last: it is also an angle of Kawasaki's.
TIME = ('time', 'timestamp', 'stamp', 'timefromstart', 'elapsed', 'zeit', 't')
TRIGGER = (
    'spraying', 'trigger', 'gun', 'gunon', 'on', 'spray', 'sprayon', 'atomizeron', 'paint',
    'painton', 'applicator',
)  # fmt: skip
FLOW = ('flow', 'relativeflow')
BRUSH = ('brush', 'brushnumber', 'brushno', 'brushindex')
SPEED = ('speed', 'velocity', 'v', 'tcpspeed')
FRAME = ('frame', 'frameid', 'headerframeid')
POSITION = ('x', 'y', 'z')
QUATERNION = ('qx', 'qy', 'qz', 'qw')
# ABB's names, the scalar first.
QUATERNION_ABB = ('q2', 'q3', 'q4', 'q1')
ROTATION_VECTOR = ('rx', 'ry', 'rz')
EULER = ('ex', 'ey', 'ez')
ROLL_PITCH_YAW = ('roll', 'pitch', 'yaw')
# Angles in the order in which a convention takes them.
IN_ORDER = (
    ('a', 'b', 'c'), ('w', 'p', 'r'), ('alpha', 'beta', 'gamma'), ('phi', 'theta', 'psi'),
    ('e1', 'e2', 'e3'), ('o', 'a', 't'),
)  # fmt: skip
# What a heading says of a pose beside the coordinate itself.
BESIDE = (
    'tcp', 'tool', 'pose', 'position', 'pos', 'actual', 'act', 'robot', 'header', 'field', 'p',
)  # fmt: skip
# What stands before an axis in the columns of an orientation, and what it makes of it.
ROTATED = {
    **dict.fromkeys(('orientation', 'quaternion', 'quat', 'q'), 'q'),
    **dict.fromkeys(('rot', 'rotation', 'rotvec', 'rv', 'r'), 'r'),
    **dict.fromkeys(('euler', 'angle', 'e'), 'e'),
}
UNITS = {
    'm': 1.0, 'mm': 1e-3, 'cm': 1e-2, 's': 1.0, 'sec': 1.0, 'ms': 1e-3, 'us': 1e-6, 'µs': 1e-6,
    'ns': 1e-9, 'rad': 1.0, 'deg': 0.0174532925199432957, '°': 0.0174532925199432957,
    'm/s': 1.0, 'mm/s': 1e-3, 'mpers': 1.0, 'mmpers': 1e-3, '-': 1.0,
}  # fmt: skip
LENGTHS, TIMES = ('m', 'mm', 'cm'), ('s', 'sec', 'ms', 'us', 'µs', 'ns')
SPEEDS = ('m/s', 'mm/s', 'mpers', 'mmpers')


@dataclass(frozen=True)
class Heading:
    """A heading: as it is written, its bare name, and its unit, '' where it tells none."""

    text: str
    name: str
    unit: str

    @staticmethod
    def of(text: str) -> Heading:
        """'X [mm]', 'x_mm', 'tcp.position.x' and '/pose/orientation/w' are understood."""
        words = text.strip().lstrip('#%').strip().casefold()
        bracketed = re.fullmatch(r'(.*?)[\s_]*[\[(](.*?)[\])]', words)
        if bracketed:
            words, unit = bracketed[1], bracketed[2].strip()
        else:
            ends = re.fullmatch(r'(.*?)[\s_]+(mm_per_s|m_per_s|[^\s_]+)', words)
            unit = ends[2].replace('_', '') if ends else ''
            words, unit = (ends[1], unit) if ends and unit in UNITS else (words, '')
        parts = [part for part in re.split(r'[^\w°]+|_+', words) if part]
        turned = [ROTATED[part] for part in parts[:-1] if part in ROTATED]
        if turned and parts[-1] in ('x', 'y', 'z', 'w'):
            return Heading(text, turned[-1] + parts[-1], unit)
        kept = [part for part in parts if part not in BESIDE] or parts
        # A logger's path to a coordinate: what is before it names the message.
        known = (*POSITION, *QUATERNION, *ROTATION_VECTOR, *ROLL_PITCH_YAW)
        return Heading(text, kept[-1] if kept and kept[-1] in known else ''.join(kept), unit)


@dataclass(frozen=True)
class Headings:
    """The headings of a table, to be asked for columns."""

    all: Sequence[Heading]

    def find(self, *names: str) -> int | None:
        """The column that is called by the first of these names that occurs.

        Raises:
            RecordingError: two columns are called so.
        """
        for name in names:
            found = [column for column, heading in enumerate(self.all) if heading.name == name]
            if len(found) > 1:
                raise RecordingError(f'{self.written(found)} could all be {name}; keep one')
            if found:
                return found[0]
        return None

    def find_all(self, names: Sequence[str]) -> list[int] | None:
        """The columns of all these names, None if one of them is missing."""
        found = [column for name in names if (column := self.find(name)) is not None]
        return found if len(found) == len(names) else None

    def named(self, text: str) -> int | None:
        """The column whose heading is written like this."""
        same = [k for k, heading in enumerate(self.all) if heading.text.strip() == text.strip()]
        return same[0] if same else None

    def written(self, columns: Sequence[int]) -> str:
        """Headings as the file has them."""
        return ' '.join(self.all[column].text.strip() for column in columns)
