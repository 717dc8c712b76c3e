"""The report: complete for every verdict, self-contained, and drawn by a real browser."""

import re
from base64 import b64decode
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from chromium import CHROMIUM, Chromium
from paint_deposition.effects.catalogue import EFFECTS, learned_law
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.inference.comparison.comparison import compare
from paint_deposition.inference.comparison.profiles import profiles_of
from paint_deposition.inference.design.proposals import Place, Spray
from paint_deposition.inference.diagnosis.refit import refit
from paint_deposition.inference.diagnosis.verdict import EffectClass
from paint_deposition.inference.fitting.estimates import Estimate
from paint_deposition.inference.fitting.outliers import Outlier
from paint_deposition.report.data import ReportData, law_rows
from paint_deposition.report.page import point_rows, report_html
from report.web_page import Page
from small_campaign import small_campaign
from waiting import until

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures('undrawn')]


@pytest.fixture(scope='module')
def diagnosis(tmp_path_factory):
    """What a diagnosis that is sure of a draught would say."""
    campaign = small_campaign(tmp_path_factory.mktemp('campaign'))
    found = refit(campaign, DepositionModel(), EFFECTS['air_drift'])
    sure = replace(found.classes[0], probability=0.97)
    return replace(found, verdict='effect_missing', classes=(sure,), library=EFFECTS)


@pytest.fixture(scope='module')
def comparisons(diagnosis):
    return tuple(compare(diagnosis.study, step.model) for step in diagnosis.history)


def of(told, beside, proposals=((), ()), older=()) -> ReportData:
    told = replace(told)
    vars(told).update(comparisons=beside, proposals=proposals)
    return ReportData(told, older)


@pytest.fixture(scope='module')
def tell(diagnosis, comparisons):
    """`tell(diagnosis)`: the report of one whose comparisons and films are known already."""
    painted = of(diagnosis, comparisons).painted

    def tell(told, beside=comparisons, proposals=((), ()), older=()) -> str:
        data = of(told, beside, proposals, older)
        vars(data).update(painted=[films[: len(beside)] for films in painted])
        return report_html(data)

    return tell


@pytest.fixture(scope='module')
def report(tell, diagnosis):
    door = diagnosis.study.campaign.experiments[1]
    places = [Place(door.points.positions_m[k], door.name, 'tells them apart') for k in (3, 20)]
    sprays = [Spray('the same passes at half the flow', ('air_drift', 'tcp_tilt'), 4.2, 0.6)]
    return tell(diagnosis, proposals=(places, sprays))


@pytest.fixture(scope='module')
def particular(tell, diagnosis, comparisons):
    """Of a part with a head and a target, a history and a slip: the page, and its comparisons."""
    told = {
        'head': {'part': 'door <left>', 'batch': '4711'}, 'name': 'door.yaml',
        'target_um': float(np.median(diagnosis.study.measured_um)), 'tolerance_um': 2.0,
    }  # fmt: skip
    older = [
        {'added': 'pattern', 'rmse_um': 7.77, 'holdout_rmse_um': 8.88, 'noise_floor_um': 0.66,
         'campaign': 'panel.yaml'},
        {'added': 'tcp_tilt', 'rmse_um': 6.66, 'campaign': 'panel.yaml'},
    ]  # fmt: skip
    campaign = replace(diagnosis.study.campaign, **told)
    slip = Outlier('door: P007', 312.0, 30.9, 1.2)
    study = replace(diagnosis.study, campaign=campaign, outliers=(slip,))
    beside = tuple(replace(comparison, study=study) for comparison in comparisons)
    return Page(tell(replace(diagnosis, study=study), beside, older=older)), beside


def test_ids_are_unique_and_nothing_is_loaded_from_anywhere(report):
    page = Page(report)
    assert page.open == page.clashes == []
    ids = [attributes['id'] for _, attributes in page.elements if 'id' in attributes]
    assert len(ids) == len(set(ids))
    links = [a['href'] for _, a in page.elements if 'href' in a]
    assert links
    assert {link.removeprefix('#') for link in links} <= set(ids)
    for tag, attributes in page.elements:
        assert not {'srcset', 'data', 'action', 'poster'} & set(attributes), tag
        assert attributes.get('src', 'data:image/png;').startswith('data:image/png;'), tag
        assert attributes.get('href', '#').startswith('#'), tag
    policy = next(a['content'] for t, a in page.elements if t == 'meta' and 'http-equiv' in a)
    assert "default-src 'none'" in policy
    assert 'http' not in policy
    style = re.search(r'<style>(.*?)</style>', report, re.DOTALL).group(1)
    assert 'url(' not in style
    assert '@import' not in style
    assert len(report) < 8e6


def test_every_part_and_all_profiles_are_shown_as_pictures(report, diagnosis):
    """Each by itself and as wide as a phone, so that no lettering is larger than another."""
    pictures = [a['src'] for tag, a in Page(report).elements if tag == 'img']
    profiles = profiles_of(diagnosis.study, [DepositionModel()])
    assert len(pictures) == 3 * len(diagnosis.study.campaign.experiments) + len(profiles)
    for picture in pictures:
        content = BytesIO(b64decode(picture.removeprefix('data:image/png;base64,')))
        rgb = np.asarray(Image.open(content).convert('RGB'), dtype=int)
        assert rgb.shape[1] == 570
        assert rgb.shape[0] < 900
        assert np.mean(np.ptp(rgb, axis=2) > 40) > 0.005


def test_the_verdict_comes_in_words_and_figures(report, diagnosis):
    text = Page(report).text
    first, last = diagnosis.history[0], diagnosis.history[-1]
    for figure in (first.rmse_um, last.rmse_um, first.holdout_rmse_um, last.holdout_rmse_um):
        assert f'{figure:.2f}' in text
    assert 'The model lacked air drift' in text
    assert f'{diagnosis.study.noise_floor_um:.2f}' in text
    assert 'The same passes at half the flow' in text
    shift = next(iter(diagnosis.classes[0].parameters.values())).value
    assert f'{1e3 * shift:.3g}'.replace('-', '−') in text


def test_every_point_is_told_with_its_verdict(report, comparisons):
    points = comparisons[-1].points
    deviation = re.findall(r'data-sort="([^"]*)"', report)
    assert np.array(deviation, dtype=float) == pytest.approx(points.residual_um)
    off = np.abs(points.residual_um) > 1.96 * points.sigma_um
    told = re.findall(r'<td class="(?:ok|off)">(OK|off)</td>', report)
    assert told == ['off' if one else 'OK' for one in off]


def test_the_cost_is_what_the_pattern_cannot_imitate(report, diagnosis, comparisons):
    without, with_it = (step.fit.predicted_um for step in diagnosis.history)
    rms = np.sqrt(np.mean((with_it - without) ** 2))
    text = Page(report).text
    assert f'the prediction changes by {rms:.2f} µm RMS over the points' in text
    # The drift alone moves more paint: the fitted pattern takes up a part of it.
    fitted = diagnosis.history[-1].model
    alone = diagnosis.study.forward.predict_um(fitted.model_copy(update={'effects': ()}))
    assert rms < np.sqrt(np.mean((with_it - alone) ** 2))


def test_part_batch_and_target_of_the_campaign_lead_the_page(particular, diagnosis):
    page, beside = particular
    study = beside[0].study
    measured, target = study.measured_um, study.campaign.target_um
    assert page.clashes == page.open == []
    assert 'Part door <left> Batch 4711 An effect is missing' in page.text
    rows = point_rows(of(diagnosis, beside))
    for name, holds in (('low', measured < target - 2.0), ('high', measured > target + 2.0)):
        assert [row['film'] == name for row in rows] == holds.tolist()
    panel = measured[: len(study.campaign.experiments[0])]
    low, high = np.mean(panel < target - 2.0), np.mean(panel > target + 2.0)
    shares = f'points: {100 * low:.0f} % low, {100 * (1 - low - high):.0f} % in'
    assert shares in page.text


@pytest.mark.parametrize('which', range(5))
def test_every_verdict_has_its_report(tell, diagnosis, comparisons, which):
    base = {'accepted': (), 'classes': (), 'history': diagnosis.history[:1]}
    drift, fog = (
        EffectClass(members, 0.4, members[0], {name: Estimate('', 0.01, 0.005, 0.0, 0.02, True)})
        for members, name in (
            (('air_drift',), 'shift_down_m'), (('fog_gradient', 'tcp_tilt'), 'fog_um')
        )
    )  # fmt: skip
    broken = {'reason': 'the fit did not converge', 'p_value': 1.0}
    words, verdict, changes = (
        ('agrees with the readings', 'none_missing', base),
        ('cannot be trusted', 'fit_broken', base | broken),
        ('do not say what', 'undecided', base | {'classes': (drift, fog)}),
        ('Something more is, most likely fog gradient (or TCP tilt) (40 %).', 'undecided',
         {'classes': (diagnosis.classes[0], fog)}),
        ('No known effect explains', 'unknown_effect', {}),
    )[which]  # fmt: skip
    other = replace(diagnosis, verdict=verdict, **changes)
    page = Page(tell(other, comparisons[: len(other.history)]))
    assert words in page.text
    assert page.open == page.clashes == []
    assert ('Air drift was added with' in page.text) == ('air_drift' in other.accepted)
    assert ('no effect was added' in page.text) == (not other.accepted)


def test_an_effect_added_as_asked_is_told_whatever_the_verdict(tell, diagnosis):
    for verdict, probability, title in (
        ('none_missing', 0.02, 'The readings do not call for air drift'),
        ('undecided', 0.7, 'The readings do not settle whether air drift was missing'),
    ):
        asked = replace(diagnosis.classes[0], probability=probability)
        text = Page(tell(replace(diagnosis, verdict=verdict, classes=(asked,), p_value=1e-3))).text
        assert 'run the diagnosis to find the cause' in text
        assert title in text
        assert 'Air drift was added with' in text
        assert 'no effect was added' not in text


def test_the_whole_history_is_told_each_step_with_its_campaign(particular, diagnosis):
    """And readings left out, and levels of parts."""
    errors = [f'{step.rmse_um:.2f} {step.holdout_rmse_um:.2f}' for step in diagnosis.history]
    floor, text = f'{diagnosis.study.noise_floor_um:.2f}', particular[0].text
    assert (
        'pattern of eq. (1) alone panel.yaml 7.77 8.88 0.66 + TCP tilt panel.yaml 6.66 '
        f'model as given, refitted door.yaml {errors[0]} {floor} '
        f'+ air drift door.yaml {errors[1]} {floor}'
    ) in text
    assert '312.00 µm at door P007, where 30.90 µm is expected (was it 31.20 µm?)' in text
    for amount in diagnosis.random_effects:
        assert f'{amount.kind} of {amount.of}' in text


# What goes wrong before the page listens, and what its policy blocks.
COMPLAINTS = """<script>
globalThis.complaints = [];
for (const kind of ['error', 'securitypolicyviolation'])
  addEventListener(kind, event => complaints.push(event.message ?? event.blockedURI), true);
</script>"""
SORTED_BY_DEVIATION = """
const table = document.querySelector('table.sortable'), cells = [...table.tHead.rows[0].cells];
const column = cells.findIndex(cell => cell.textContent.includes('Deviation'));
cells[column].click();
[...table.tBodies[0].rows].map(row => Number(row.cells[column].dataset.sort))"""
FOLD = "document.getElementById('model').closest('.fold')"
TOO_WIDE = """[...document.querySelectorAll('header *, main *, footer *')].some(element =>
  !element.closest('.rows, svg, .top, .pair') && element.getBoundingClientRect().right > 391)"""


@pytest.mark.skipif(CHROMIUM is None, reason='draws the page in Chromium, which is not installed')
def test_a_browser_draws_every_chart_without_errors(report, comparisons, tmp_path):
    page = tmp_path / 'page.html'
    page.write_text(report.replace('<head>', f'<head>{COMPLAINTS}'))
    with Chromium(tmp_path / 'browser') as browser:
        tab = browser.tab(page.as_uri(), 1400, 1400)
        tab.wait_until('document.documentElement?.dataset.ready !== undefined')
        charts = "[...document.querySelectorAll('.chart')].map(one => one.dataset.drawn)"
        drawn = tab.evaluate(charts)
        assert len(drawn) >= 4
        assert set(drawn) == {''}
        picture = tmp_path / 'page.png'
        until(lambda: colourful_share(tab.picture(picture)) > 0.02, 'a residual on the part')
        assert tab.evaluate(SORTED_BY_DEVIATION) == sorted(comparisons[-1].points.residual_um)
        tab.evaluate(f"{FOLD}.open = false; location.hash = '#model'")
        tab.wait_until(f'{FOLD}.open')
        size = {'width': 390, 'height': 844, 'deviceScaleFactor': 1, 'mobile': False}
        tab.call('Emulation.setDeviceMetricsOverride', **size)
        tab.wait_until(f'innerWidth === 390 && !{TOO_WIDE}')
        assert tab.evaluate('complaints') == []
        assert tab.evaluate('document.documentElement.dataset.errors ?? null') is None


def colourful_share(picture: Path) -> float:
    """Share of pixels that are clearly red or blue: the residual on the part."""
    rgb = np.asarray(Image.open(picture).convert('RGB'), dtype=int)[600:]
    return float(np.mean(np.abs(rgb[:, :, 0] - rgb[:, :, 2]) > 40))


def test_a_law_learned_as_asked_is_no_verdict(diagnosis):
    campaign = diagnosis.study.campaign
    done = refit(campaign, DepositionModel(), learned_law('height_fraction'))
    page = Page(report_html(ReportData(done)))
    assert 'Added as asked' in page.text
    assert 'no known effect' not in page.text
    (law,) = law_rows(ReportData(done))
    told = f"neutral outside the readings' range, {law['ends']}. At 95 % it is known best, to "
    assert f'{told}{law["best"]}, and least, to {law["least"]}.' in page.text
    assert re.fullmatch(r'± [\d.]+ µm at [\d.]+', law['best'])
    before, after = (f'{step.holdout_rmse_um:.2f} µm' for step in done.history)
    assert f'held out of the fit: {before} → {after}; beyond gauge and texture: ' in page.text
    assert page.open == page.clashes == []
