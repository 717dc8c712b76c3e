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
@click.option('--truth', help="Hidden effect; 'a+b' for two, 'unknown:*' for any. Default: none.")
@click.option('--out', required=True, type=click.Path(file_okay=False), help='New folder.')
@click.option(
    '--experiments', default='door', help=f'Comma-separated, of {", ".join(EXPERIMENTS)}.'
)
@click.option('--panel-index', type=float, help='Paint a flat three-pass panel at this index (m).')
@click.option('--readings', default=100, show_default=True)
@click.option('--repeats', default=25, show_default=True)
@click.option('--style', type=click.Choice(['columns', 'rows', 'random']))
@click.option('--amplitude', type=float, help="In the effect's own unit.")
@click.option('--scale', default=1.0, help='Multiplies a drawn amplitude.')
@click.option('--outliers', default=0.0, help='Fraction of gross errors.')
@click.option('--heavy-tails', is_flag=True, help='Student noise, 4 degrees of freedom.')
@click.option('--session-offset', default=0.0, help='Deviation of one gauge offset a part, um.')
@click.option('--follow', type=click.FloatRange(0, 1), help='Tool axis: 0 fixed, 1 normal.')
@click.option('--parcels', default=PARCELS, show_default=True, help='Fewer: faster, noisier film.')
def main(
    out, panel_index, experiments, style, scale, follow, outliers, heavy_tails, session_offset,
    **job,
):  # fmt: skip
    """Paint a random part with a hidden effect and write the campaign's files."""
    job['noise'] = GaugeNoise(
        heavy_tails=heavy_tails, outlier_fraction=outliers, session_offset_um=session_offset
    )
    try:
        if panel_index:
            campaign = panel_study(index_m=panel_index, **job)
        else:
            job |= {'style': style, 'scale': scale, 'follow': follow}
            campaign = generate(experiments=tuple(experiments.split(',')), **job)
        click.echo(write(campaign, out))
    except (ValueError, FileExistsError) as error:
        click.echo(str(error), err=True)
        sys.exit(2)


if __name__ == '__main__':
    main()
