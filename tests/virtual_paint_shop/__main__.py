"""Command: python -m tests.virtual_paint_shop --seed 7 --truth air_drift --out DIR."""

from __future__ import annotations

import sys

import click

from .draw import EXPERIMENTS
from .files import write
from .gauge import GaugeNoise
from .shop import PARCELS, generate, panel_study
from .truths import library


@click.command(epilog='Truths: ' + ', '.join(sorted(library())))
@click.option('--seed', type=int, required=True, help='Same seed, same job.')
@click.option(
    '--truth',
    default=None,
    help="Hidden effect; 'a+b' for two, 'unknown:*' for any. Default: none.",
)
@click.option('--out', required=True, type=click.Path(file_okay=False), help='New folder.')
@click.option(
    '--experiments',
    default='door',
    show_default=True,
    help=f'Comma-separated, of {", ".join(EXPERIMENTS)}.',
)
@click.option(
    '--panel-index',
    type=float,
    default=None,
    help='Paint a flat three-pass panel at this index (m) instead.',
)
@click.option('--readings', type=int, default=100, show_default=True)
@click.option('--repeats', type=int, default=25, show_default=True)
@click.option('--style', type=click.Choice(['columns', 'rows', 'random']), default=None)
@click.option('--amplitude', type=float, default=None, help="In the effect's own unit.")
@click.option(
    '--scale', type=float, default=1.0, show_default=True, help='Multiplies a drawn amplitude.'
)
@click.option(
    '--outliers', type=float, default=0.0, show_default=True, help='Fraction of gross errors.'
)
@click.option('--heavy-tails', is_flag=True, help='Student noise, 4 degrees of freedom.')
@click.option(
    '--session-offset',
    type=float,
    default=0.0,
    show_default=True,
    help='Standard deviation of one gauge offset per part, um.',
)
@click.option(
    '--follow', type=click.FloatRange(0, 1), default=None, help='Tool axis: 0 fixed, 1 normal.'
)
@click.option(
    '--parcels', type=int, default=PARCELS, show_default=True, help='Fewer: faster, noisier film.'
)
def main(
    seed,
    truth,
    out,
    experiments,
    panel_index,
    readings,
    repeats,
    style,
    amplitude,
    scale,
    outliers,
    heavy_tails,
    session_offset,
    follow,
    parcels,
):
    """Paint a random part with a hidden effect and write the campaign's files."""
    noise = GaugeNoise(
        heavy_tails=heavy_tails, outlier_fraction=outliers, session_offset_um=session_offset
    )
    try:
        if panel_index:
            campaign = panel_study(
                seed,
                panel_index,
                truth=truth,
                readings=readings,
                repeats=repeats,
                noise=noise,
                amplitude=amplitude,
                parcels=parcels,
            )
        else:
            campaign = generate(
                seed,
                truth,
                experiments=tuple(experiments.split(',')),
                readings=readings,
                repeats=repeats,
                style=style,
                noise=noise,
                amplitude=amplitude,
                scale=scale,
                follow=follow,
                parcels=parcels,
            )
        click.echo(write(campaign, out))
    except (ValueError, FileExistsError) as error:
        click.echo(str(error), err=True)
        sys.exit(2)


if __name__ == '__main__':
    main()
