"""The messages, services and actions, as their files say."""

import re
from pathlib import Path

from generated.markdown import definitions

PAINT_MSGS = Path(__file__).resolve().parents[3] / 'ros2_ws/src/paint_msgs'
# What the parts of a file are, between its lines of dashes.
PARTS = {'msg': ('',), 'srv': ('Request', 'Response'), 'action': ('Goal', 'Result', 'Feedback')}


def text() -> str:
    """A section for each file."""
    return '\n'.join(
        _section(file, kind, names)
        for kind, names in PARTS.items()
        for file in sorted((PAINT_MSGS / kind).iterdir())
    )


def _section(file: Path, kind: str, names: tuple[str, ...]) -> str:
    lines = [f'## {file.stem} ({kind})\n']
    for name, part in zip(names, file.read_text(encoding='utf-8').split('---\n'), strict=True):
        about, fields = _read(part)
        lines += [about, '', f'**{name}**\n' if name else '', definitions(fields)]
    return '\n'.join(lines)


def _read(part: str) -> tuple[str, list[tuple[str, str]]]:
    """What the comments before all fields say, and each field with its comment."""
    about, fields = [], []
    for line in part.splitlines():
        field, _, comment = (piece.strip() for piece in line.partition('#'))
        if field:
            fields.append([re.sub(r' +', ' ', field), comment])
        elif comment and fields and line.startswith(' '):  # goes on from the line before
            fields[-1][1] += f' {comment}'
        elif comment:
            about.append(comment)
    return '\n'.join(about), [(field, comment or 'as its type says') for field, comment in fields]
