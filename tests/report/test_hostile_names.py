"""Names from files are shown in a report, and never run in it."""

from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.inference.comparison.comparison import compare
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import Experiment
from paint_deposition.report.data import ReportData
from paint_deposition.report.page.report import report_html
from small_campaign import small_campaign

HOSTILE = '</script><script>alert(1)</script><img src=x onerror="alert(2)">\'"'


class Elements(HTMLParser):
    """The tags of a page, and whatever would run when it is opened."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.scripts, self.handlers = 0, []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.scripts += tag == 'script'
        self.handlers += [name for name, _ in attributes if name.startswith('on')]


@pytest.mark.slow
def test_a_name_with_script_tags_is_text_in_the_report(tmp_path, undrawn):
    """The name of a part, a batch and each point."""

    def page(name: str) -> str:
        campaign = small_campaign(tmp_path / str(len(name)), experiments=('door',))
        (one,) = campaign.experiments
        points = np.array([f'{name}{k}' for k in range(len(one.readings))])
        named = Experiment.of(name, one.surface, one.path, replace(one.readings, point=points))
        head = dict.fromkeys(('part', 'batch', 'paint', 'operator'), name)
        study = Study.of(replace(campaign, experiments=(named,), head=head))
        return report_html(ReportData((compare(study, DepositionModel()),)))

    plain, hostile = page('door'), page(HOSTILE)
    assert '&lt;script&gt;alert(1)' in hostile
    assert HOSTILE not in hostile
    expected, found = Elements(plain), Elements(hostile)
    assert found.scripts == expected.scripts
    assert found.handlers == expected.handlers
