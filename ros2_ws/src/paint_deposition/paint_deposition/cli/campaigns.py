"""Campaigns read for a command, with the notes on them on stderr, and the steps that follow."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click
from tqdm import tqdm

from paint_deposition.cli.options import SHOW_PROGRESS_AFTER_S

if TYPE_CHECKING:
    from paint_deposition.readings.campaign import Campaign


def read_noted(path: Path, tell: Callable[[str], None]) -> Campaign:
    """Read a campaign; `tell` gets each line of progress, stderr each note on an experiment."""
    from paint_deposition.files.campaign_file import read_campaign

    def show(line: str) -> None:
        tell(line)
        if not line.startswith('reading '):
            click.echo(f'note: {line}', err=True)

    return read_campaign(path, show)


class Steps:
    """Progress of work in steps of unknown length; nothing when piped."""

    def __init__(self, name: str) -> None:
        self._bar = tqdm(
            desc=name, bar_format='{desc}: {postfix} [{elapsed}]', disable=None,
            delay=SHOW_PROGRESS_AFTER_S, leave=False, file=sys.stderr,
        )  # fmt: skip

    def __enter__(self) -> Callable[[str], None]:
        return self._tell

    def __exit__(self, *error: object) -> None:
        self._bar.close()

    def _tell(self, line: str) -> None:
        self._bar.set_postfix_str(line)
        self._bar.update()
