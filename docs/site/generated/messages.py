"""The messages, services and actions, as their files say."""

from pathlib import Path

from generated.markdown import code

PAINT_MSGS = Path(__file__).resolve().parents[3] / 'ros2_ws/src/paint_msgs'


def text() -> str:
    """A section for each file; its comments give meaning and unit of each field."""
    return '\n'.join(
        f'## {file.stem} ({kind})\n\n{code(file.read_text(encoding="utf-8"))}'
        for kind in ('msg', 'srv', 'action')
        for file in sorted((PAINT_MSGS / kind).iterdir())
    )
