"""Pictures of a calibration: one pass with its parts, and measured beside predicted film."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from paint_deposition.film.pass_film import sampled_collapse
from paint_deposition.inference.fitting.calibration import Calibration, PanelFit
from paint_deposition.report.pictures.chart import MM, legend, new_figure, quiet, save_picture
from paint_deposition.report.style import ACCENT, COMPONENTS, INK, MUTED

LINE_POINTS = 600


def write_calibration_pictures(
    folder: str | Path, calibration: Calibration, suffix: str = 'png'
) -> list[Path]:
    """Write what the campaign allows: ``collapse.png``, ``profiles.png``, ``agreement.png``."""
    folder = Path(folder)
    written = []
    panels = [(k, panel) for k, panel in enumerate(calibration.panels) if panel is not None]
    if panels:
        figure = new_figure(6.4, 4.2)
        draw_collapse(figure.subplots(), calibration, panels[0][1])
        written.append(save_picture(figure, folder / f'collapse.{suffix}'))
        figure = new_figure(8.0, 2.6 * len(panels) + 0.4)
        rows = figure.subplots(len(panels), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
        for axes, (number, panel) in zip(rows, panels, strict=True):
            draw_panel(axes, calibration, number, panel)
        for axes in rows[:-1]:
            axes.set_xlabel('')
        legend(rows[0], loc='lower center', ncols=2)
        written.append(save_picture(figure, folder / f'profiles.{suffix}'))
    figure = new_figure(5.2, 5.0)
    study, predicted_um = calibration.study, calibration.fit.predicted_um
    draw_agreement(figure.subplots(), study.measured_um, predicted_um, study.sigma_um)
    return [*written, save_picture(figure, folder / f'agreement.{suffix}')]


def draw_collapse(axes: Axes, calibration: Calibration, one: PanelFit) -> None:
    """Draw eq. (3) of a panel with its three Gaussians, and the 2D model's own collapse."""
    quiet(axes, 'across the pass [mm]', 'film [µm]', 'One pass, eq. (3)')
    fitted, panel = one.collapse.collapse, one.panel
    x = np.linspace(-0.6, 0.6, LINE_POINTS) * fitted.reach_m
    names = (r'at $+r_1$', r'at $-r_2$', 'centred')
    for part, name, colour in zip(fitted.components_um(x), names, COMPONENTS, strict=True):
        axes.plot(MM * x, part, color=colour, linewidth=1.3, linestyle='--', label=name)
    axes.plot(MM * x, fitted.thickness_um(x), color=INK, linewidth=2.0, label='sum of the three')
    own = sampled_collapse(
        calibration.model.painting_with(panel.brush),
        float(panel.speed_m_per_s[0]),
        standoff_m=panel.distance_m,
        travel_rad=panel.travel_rad,
    )
    axes.plot(
        MM * x, own.thickness_um(x), color=ACCENT, linewidth=1.6, label='2D model, collapsed'
    )
    axes.set_xlim(MM * x[0], MM * x[-1])
    axes.set_ylim(bottom=0.0)
    legend(axes, loc='upper right')


def draw_panel(axes: Axes, calibration: Calibration, number: int, one: PanelFit) -> None:
    """Draw the film across a panel, an experiment of this number, as measured and as predicted."""
    study, panel = calibration.study, one.panel
    rows = study.campaign.experiment_of == number
    measured, predicted = study.measured_um[rows], calibration.fit.predicted_um[rows]
    quiet(
        axes, 'across the passes [mm]; dotted: tool path', 'film [µm]',
        f'{study.campaign.experiments[number].name}: mean {measured.mean():.2f} µm measured, '
        f'{predicted.mean():.2f} µm predicted; SD of residual '
        f'{(measured - predicted).std():.2f} µm',
    )  # fmt: skip
    middle = panel.passes_m.mean()
    for line in panel.passes_m - middle:
        axes.axvline(MM * line, color=MUTED, linewidth=0.8, linestyle=':')
    across = np.linspace(panel.across_m.min(), panel.across_m.max(), LINE_POINTS)
    axes.plot(
        MM * (across - middle), panel.film_um(calibration.model, across), color=ACCENT,
        linewidth=1.8, label='model',
    )  # fmt: skip
    axes.errorbar(
        MM * (panel.across_m - middle), measured, study.sigma_um[rows],
        fmt='o', color=INK, markersize=3.5, linewidth=0.8, label='measured',
    )  # fmt: skip
    axes.set_ylim(bottom=0.0)


def draw_agreement(
    axes: Axes, measured_um: np.ndarray, predicted_um: np.ndarray, sigma_um: np.ndarray
) -> None:
    """Draw measured over predicted film, (P,) each with the gauge's standard deviation [um]."""
    quiet(axes, 'predicted [µm]', 'measured [µm]', 'All points')
    top = 1.08 * float(max(predicted_um.max(), measured_um.max()))
    axes.plot([0.0, top], [0.0, top], color=MUTED, linewidth=0.9, linestyle='--')
    axes.errorbar(
        predicted_um, measured_um, sigma_um, fmt='o', color=ACCENT, markersize=3.5, linewidth=0.8
    )
    axes.set_xlim(0.0, top)
    axes.set_ylim(0.0, top)
    axes.set_aspect('equal')
