"""A diagnosis in a process of its own: a cancel ends it at once, the node answers meanwhile."""

from __future__ import annotations

import multiprocessing
import shutil
import signal
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from paint_deposition.errors import PaintError
from paint_deposition.nodes.runtime.model_parameters import effect_loader

if TYPE_CHECKING:
    from paint_deposition.nodes.runtime.long_work import Tell

LOOK_S = 0.1


@dataclass(frozen=True)
class Task:
    """What to diagnose.

    Attributes:
        campaign_file: the readings.
        model_file: to start from; '': that of the campaign, if it names one.
        folder: for the files, not there yet.
        allow_user_effects: whether the model's effect files may run.
    """

    campaign_file: str
    model_file: str
    folder: Path
    allow_user_effects: bool


def diagnosed(task: Task, tell: Tell) -> dict[str, Any]:
    """The fields of the action's result, by name; nothing is left of work that is broken off.

    Args:
        task: what to diagnose.
        tell: called with each step, and ten times a second; what it raises ends the work.

    Raises:
        PaintError: the diagnosis refuses its input, or its process ended.
    """
    receiver, sender = multiprocessing.Pipe(duplex=False)
    process = multiprocessing.get_context('spawn').Process(
        target=_work, args=(task, sender), name='diagnosis', daemon=True
    )
    # Ctrl-C goes to all processes of a terminal; the node's own ends the work.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        process.start()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    sender.close()
    result: dict[str, Any] | None = None
    try:
        with receiver:
            result = _followed(receiver, tell)
    finally:
        process.kill()
        process.join()
        if result is None:
            shutil.rmtree(task.folder, ignore_errors=True)
    return result


def _followed(receiver: Connection, tell: Tell) -> dict[str, Any]:
    stage = 'starting'
    while True:
        tell(stage, 0.0)
        try:
            news = receiver.recv() if receiver.poll(LOOK_S) else stage
        except EOFError:
            raise PaintError('the process of the diagnosis has ended before its work') from None
        if isinstance(news, PaintError):
            raise news
        if isinstance(news, dict):
            return news
        stage = news


def _work(task: Task, sender: Connection) -> None:
    """In the process: send each step, and at last the result or why there is none."""
    # Pictures and fits take seconds to load, which a node that only plans need not wait for.
    from paint_deposition.api.inference import diagnose
    from paint_deposition.report.writers.write import write
    from paint_deposition.files.campaign_file import read_campaign
    from paint_deposition.files.model_file import read_model_file

    try:
        campaign = read_campaign(task.campaign_file, sender.send)
        chosen = task.model_file or campaign.model_file
        load = effect_loader({'allow_user_effects': task.allow_user_effects})
        start = read_model_file(chosen, load) if chosen else None
        found = diagnose(
            replace(campaign, model_file=None),
            start.model if start else None,
            posterior=start.posterior if start else None,
            progress=sender.send,
        )
        sender.send('writing')
        files = write(found, task.folder, start=start)
    except PaintError as error:
        sender.send(PaintError(str(error)))
        return
    before, after = found.history[0], found.history[-1]
    sender.send(
        {
            'message': found.reason,
            'verdict': found.verdict,
            'p_value': float(found.p_value),
            'accepted': list(found.accepted),
            'rmse_before_um': float(before.rmse_um),
            'rmse_after_um': float(after.rmse_um),
            'paths': [str(file) for file in files],
        }
    )
