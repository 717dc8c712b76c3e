"""Options of `plan` for a part with several sides, and what is said of its faces."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import reduce, wraps
from typing import TYPE_CHECKING, Any

import click

import paint_deposition as pd
from paint_deposition.cli.options import NOT_NEGATIVE, POSITIVE, FiniteRange, paint_lines

if TYPE_CHECKING:
    from paint_deposition.planning.clearance import Contact

OPTIONS = (
    click.option(
        '--faces', type=click.Choice(['one', 'auto']), default='one', show_default=True,
        help='auto: split the part into faces that can be sprayed from one side each, as a hood '
        'with its flange or a bumper, and blend their seams.',
    ),
    click.option(
        '--face-angle-deg', default=40.0, show_default=True,
        type=FiniteRange(5.0, 75.0), help='A face turns away from its mean by no more.',
    ),
    click.option(
        '--gun-radius-m', default=0.08, show_default=True, type=POSITIVE,
        help='Of the gun, and of the cylinder before it that must stay free.',
    ),
    click.option(
        '--gun-length-m', default=0.4, show_default=True, type=POSITIVE,
        help='Of the gun behind its TCP.',
    ),
    click.option(
        '--keep-off-m', default=0.1, show_default=True, type=NOT_NEGATIVE,
        help='Nothing of the part may come nearer before the TCP.',
    ),
)  # fmt: skip
OF_FACES = ('faces', 'face_angle_deg', 'gun_radius_m', 'gun_length_m', 'keep_off_m')


def faces_options(command: Callable) -> Callable:
    """Give a command these options; it takes ``lay``, which lays the passes as they say.

    ``lay`` returns the plan, and where gun or spray come too near to the part.
    """

    @wraps(command)
    def with_faces(**given: Any) -> Any:
        own = {name: given.pop(name) for name in OF_FACES}

        def lay(
            surface: pd.Surface, model: pd.DepositionModel, **wanted: Any
        ) -> tuple[pd.Plan | pd.PartPlan, tuple[Contact, ...]]:
            from paint_deposition.planning.clearance import contacts

            envelope = pd.GunEnvelope(own['gun_radius_m'], own['gun_length_m'], own['keep_off_m'])
            if own['faces'] == 'one':
                planned = pd.plan(surface, model, **wanted)
                return planned, contacts(surface, planned.trajectory, envelope)
            angle = own['face_angle_deg']
            found = pd.plan_faces(
                surface, model, face_angle_deg=angle, envelope=envelope, **wanted
            )
            return found, found.contacts

        return command(lay=lay, **given)

    return reduce(lambda taken, option: option(taken), reversed(OPTIONS), with_faces)


def faces_lines(result: pd.PartPlan) -> Iterator[str]:
    """What is printed of a plan with several faces."""
    yield result.sentence
    yield result.comparison
    film = result.statistics
    yield (
        f'film {film.min_um:.1f} to {film.max_um:.1f} µm, coverage {100 * film.coverage:.0f} %, '
        f'capture fraction {100 * film.capture_fraction:.0f} %'
    )
    yield from paint_lines(result)
    if not result.contacts:
        gun = result.envelope
        yield (
            f'gun ({2e3 * gun.radius_m:.0f} mm wide, {1e3 * gun.length_m:.0f} mm long) and the '
            f'{1e3 * gun.before_m:.0f} mm before it keep clear of the part'
        )
