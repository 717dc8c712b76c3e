"""Campaigns read for a command, with the notes on them on stderr."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from paint_deposition.inference.campaign import Campaign


def read_noted(path: Path, tell: Callable[[str], None]) -> Campaign:
    """Read a campaign; `tell` gets each line of progress, stderr each note on an experiment."""
    from paint_deposition.formats.campaign_file import read_campaign

    def show(line: str) -> None:
        tell(line)
        if not line.startswith('reading '):
            click.echo(f'note: {line}', err=True)

    return read_campaign(path, show)
