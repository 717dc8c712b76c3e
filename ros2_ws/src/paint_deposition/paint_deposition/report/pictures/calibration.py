"""Pictures of a calibration: one pass with its parts, and measured beside predicted profiles."""

from pathlib import Path

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.pass_film import sampled_collapse
from paint_deposition.fitting.calibration import Calibration, PanelFit
from paint_deposition.fitting.study import Study
from paint_deposition.readings.panel import Panel
from paint_deposition.report.pictures.chart import MODEL, MUTED, new_figure, quiet, save_png
from paint_deposition.report.pictures.uniformity import Profile, write_collapse, write_profiles

LINE_POINTS = 400


def write_calibration_pictures(folder: str | Path, calibration: Calibration) -> list[Path]:
    """Write what the campaign allows: ``collapse.png``, ``profiles.png``, ``agreement.png``."""
    folder = Path(folder)
    study, model = calibration.study, calibration.model
    written = []
    first = next((panel for panel in calibration.panels if panel is not None), None)
    if first is not None:
        written.append(
            write_collapse(
                folder / 'collapse.png', first.collapse.collapse, _own_collapse(model, first)
            )
        )
        profiles = [
            profile_of(study, number, one.panel, model, calibration.fit.predicted_um)
            for number, one in enumerate(calibration.panels)
            if one is not None
        ]
        written.append(write_profiles(folder / 'profiles.png', profiles))
    written.append(_write_agreement(folder / 'agreement.png', calibration))
    return written


def profile_of(
    study: Study,
    number: int,
    panel: Panel,
    model: DepositionModel,
    predicted_um: np.ndarray,
) -> Profile:
    """Measured and predicted film of one of a study's experiments."""
    rows = study.experiment_of == number
    ends = panel.across_m.min(), panel.across_m.max()
    line = np.linspace(*ends, LINE_POINTS)
    return Profile(
        study.campaign.experiments[number].name,
        panel.across_m,
        study.measured_um[rows],
        study.sigma_um[rows],
        predicted_um[rows],
        panel.passes_m,
        (line, panel.film_um(model, line)),
    )


def _own_collapse(model: DepositionModel, one: PanelFit):
    panel = one.panel
    return sampled_collapse(
        model,
        float(panel.speed_m_per_s[0]),
        standoff_m=panel.distance_m,
        travel_rad=panel.travel_rad,
    )


def _write_agreement(path: Path, calibration: Calibration) -> Path:
    """Predicted against measured film of every point."""
    study, predicted = calibration.study, calibration.fit.predicted_um
    figure = new_figure(5.2, 5.0)
    axes = figure.subplots()
    quiet(axes, 'predicted [um]', 'measured [um]', 'All points')
    top = 1.08 * float(max(predicted.max(), study.measured_um.max()))
    axes.plot([0.0, top], [0.0, top], color=MUTED, linewidth=0.9, linestyle='--')
    axes.errorbar(
        predicted, study.measured_um, study.sigma_um,
        fmt='o', color=MODEL, markersize=3.5, linewidth=0.8,
    )  # fmt: skip
    axes.set_xlim(0.0, top)
    axes.set_ylim(0.0, top)
    axes.set_aspect('equal')
    return save_png(figure, path)
