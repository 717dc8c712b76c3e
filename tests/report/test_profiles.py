"""The picture of profiles: measured, before and after."""

from dataclasses import replace

import numpy as np
import pytest

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.inference.comparison.comparison import compare
from paint_deposition.inference.fitting.study import Study
from paint_deposition.report.data import ReportData
from paint_deposition.report.pictures.readings import comparison_figure
from small_campaign import small_campaign


@pytest.mark.slow
def test_thicker_columns_are_not_cut_off_by_a_thin_one(tmp_path):
    study = Study.of(small_campaign(tmp_path, experiments=('door',), style='columns'))
    data = ReportData((compare(study, DepositionModel()),))
    thin = data.profiles[0]
    thick = replace(thin, lines_um=2.0 * thin.lines_um)
    vars(data)['profiles'] = [thin, thick]
    figure = comparison_figure(data)
    tops_um = [film.get_ylim()[1] for film in figure.axes[::2]]
    assert tops_um[0] == tops_um[1] > np.max(thick.lines_um[0])
    few = replace(thin, line_m=np.empty(0), lines_um=np.empty((1, 0)), passes_um=np.empty((0, 0)))
    vars(data)['profiles'] = [few]
    assert len(comparison_figure(data).axes) == 2
