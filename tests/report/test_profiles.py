"""The picture of profiles: measured, before and after."""

import numpy as np
import pytest
from PIL import Image

from paint_deposition.comparison.comparison import compare
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.fitting.study import Study
from paint_deposition.report.data import ReportData
from paint_deposition.report.pictures.profiles import write_comparison_picture
from paint_deposition.report.style import ACCENT
from small_campaign import small_campaign


@pytest.mark.slow
def test_columns_and_strips_are_drawn(tmp_path):
    for style in ('columns', 'random'):
        study = Study.of(small_campaign(tmp_path / style, experiments=('door',), style=style))
        model = DepositionModel()
        data = ReportData((compare(study, model),) * 2)
        write_comparison_picture(tmp_path / f'{style}.png', data)
        image = np.asarray(Image.open(tmp_path / f'{style}.png').convert('RGB'))
        accent = [int(ACCENT[k : k + 2], 16) for k in (1, 3, 5)]
        assert np.all(image == accent, axis=2).mean() > 2e-4
        assert min(image.shape[:2]) > 400
