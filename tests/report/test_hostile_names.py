"""Names from files are shown in a report, and never run in it."""

import csv
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

import paint_deposition as pd
from paint_deposition.files.gauge_readings import write_table
from paint_deposition.inference.comparison.comparison import compare
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import Experiment
from paint_deposition.report.data import ReportData
from paint_deposition.report.page import report_html
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


@pytest.mark.parametrize(
    'name', ["=cmd|' /C calc'!A0", '+1+1', '-2+3', '@SUM(A1)', '-P1', '=1,"2"', '\t=1']
)
def test_a_name_is_no_formula_in_a_table_and_comes_back_as_it_was(name, tmp_path):
    rows = [['point', 'x_m', 'y_m', 'z_m', 'thickness_um'], [name, '-0.1', '+0.2', '1e-3', '20']]
    write_table(tmp_path / 'readings.csv', rows)
    with (tmp_path / 'readings.csv').open(newline='') as file:
        _, cells = csv.reader(file)
    assert cells == [f"'{name}", *rows[1][1:]]
    assert pd.read_readings(tmp_path / 'readings.csv').point.tolist() == [name.strip()]


@pytest.mark.parametrize('mark', ['\r', '\n', '\u2028', '\u2029', '\x85', '\x0c', '\0'])
def test_a_name_stays_in_the_comment_of_a_model(mark, tmp_path):
    hostile = f'door{mark}effects: [{{file: evil.py}}]{mark}'
    pd.write_model(tmp_path / 'model.yaml', pd.DepositionModel(), f'Calibrated on {hostile}')
    assert pd.read_model(tmp_path / 'model.yaml') == pd.DepositionModel()


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
        return report_html(ReportData((compare(study, pd.DepositionModel()),)))

    plain, hostile = page('door'), page(HOSTILE)
    assert '&lt;script&gt;alert(1)' in hostile
    assert HOSTILE not in hostile
    expected, found = Elements(plain), Elements(hostile)
    assert found.scripts == expected.scripts
    assert found.handlers == expected.handlers
