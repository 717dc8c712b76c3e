"""The command `calibrate`: the pattern of the bell from gauge readings."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import click

import paint_deposition as pd
from paint_deposition.cli.model_choice import campaign_model_words
from paint_deposition.cli.options import (
    CAMPAIGN,
    JSON,
    PART_POSE,
    PICTURES,
    file_lines,
    geometry_lines,
    model_option,
    output_option,
    read_inputs,
    say_all,
    say_geometry,
    say_results,
    seed_option,
    write_results,
)
from paint_deposition.cli.progress import Progress


@click.command('calibrate')
@CAMPAIGN
@model_option("Model to start from; default: the campaign's, else a 50 mm bell.")
@output_option('model.yaml, calibration.json and pictures')
@seed_option('the starts of the fit')
@PART_POSE
@PICTURES
@JSON
def calibrate_command(
    campaign: Path,
    model_file: Path | None,
    output: Path,
    seed: int,
    part_pose: list[float] | None,
    pictures: str,
    as_json: bool,
) -> None:
    """Fit the bell's pattern to the gauge readings of CAMPAIGN.

    Any number of panels and parts may be in it; a flat panel painted by a few passes is best. The
    effects of the model to start from are fitted as well; its projection is kept.
    """
    with Progress('calibrate') as tell:
        data, start = read_inputs(campaign, model_file, tell, part_pose)
        result = pd.calibrate(data, start.model if start else None, seed=seed, progress=tell)
        tell('writing')
        files = write_results(result, output, start=start, pictures=pictures)
    say_geometry(result)
    if not as_json:
        say_all('note', data.understood)
        say_all('warning', result.warnings)
    lines = [*_calibration_lines(result), *file_lines(files)]
    words = campaign_model_words(data, model_file, start, 'fitted to the campaign, from')
    say_results(files, as_json, lines, model=words)


def _calibration_lines(result: pd.Calibration) -> Iterator[str]:
    yield from geometry_lines(result)
    for value in result.parameters:
        mark = '' if value.determined else '   not determined'
        yield f'{value.name:>14} = {value.value:.4g}  ({value.low:.4g} to {value.high:.4g}){mark}'
    for experiment, found in zip(result.study.campaign.experiments, result.residuals, strict=True):
        yield (
            f'{experiment.name}: {len(found)} points, mean {found.measured_um.mean():.2f} µm '
            f'measured, {found.predicted_um.mean():.2f} predicted, residual SD '
            f'{found.sd_um:.2f} µm'
        )
    noise = result.study.noise
    yield (
        f'chi2 per degree of freedom {result.chi_square_per_freedom:.2f}, gauge noise '
        f'{noise.typical_um:.2f} µm ({noise.source})'
    )
