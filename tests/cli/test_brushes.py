"""Brushes on the command line: a plan with one of them, its film, and what is refused."""

import json

import pytest

from brushes import switched
from cli.command import assert_refused, figures_of, level_pass, paint, ran
from paint_deposition.files.model_file import read_model
from paint_deposition.files.recordings.bags import write_pose_bag
from scenes import stamps_ns

MODEL = """
brushes:
  1: {planar: {K1_cm3_per_s: 0.7, r_m: 0.1, sigma1_m: 0.06}, flow_cm3_per_min: 200, solids: 0.4,
      bell_speed_rpm: 30000, density_g_per_cm3: 1.1}
  2: {planar: {K1_cm3_per_s: 1.4, r_m: 0.2, sigma1_m: 0.08}, flow_cm3_per_min: 400, solids: 0.4,
      bell_speed_rpm: 50000, density_g_per_cm3: 1.1}
  3: {planar: {K1_cm3_per_s: 1.0, r_m: 0.15, sigma1_m: 0.07}, flow_cm3_per_min: 300, solids: 0.4,
      bell_speed_rpm: 40000, density_g_per_cm3: 1.1}
"""


@pytest.fixture
def model(tmp_path):
    path = tmp_path / 'model.yaml'
    path.write_text(MODEL)
    return path


def bag(tmp_path, *changes):
    """A pass before the panel along which these (time [s], flow, brush) are set."""
    stamps = stamps_ns([time_s for time_s, *_ in changes])
    motion = level_pass(**switched(stamps, *(gun for _, *gun in changes)))
    return write_pose_bag(tmp_path / 'run', motion)


@pytest.mark.slow
def test_a_recording_of_two_brushes_tells_its_paint(model, panel, tmp_path):
    """A state of a brush that the model lacks is left out, as by the nodes."""
    run = bag(tmp_path, (0.5, 1.0, 1), (0.8, 1.0, 9), (1.5, 1.0, 2), (2.5, 0.0, 0))
    given = (
        'simulate', '--mesh', panel, '--trajectory', run, '--model', model, '--state-topic',
        '/atomizer/state', '--max-edge-length-m', 0.05, '--json', '-o', tmp_path / 'film',
    )  # fmt: skip
    refusal = 'brush 9 is not in the model; its brushes: 1, 2, 3'
    assert_refused(paint(*given, '--strict'), refusal)
    done = ran(*given)
    assert f'1 states left out: {refusal}' in done.stderr
    told = json.loads(done.stdout)
    assert told['emitted_volume_cm3'] == pytest.approx(0.7 + 1.4, rel=1e-6)
    used = told['paint']
    assert used['wet_cm3'] == pytest.approx((200 + 400) / 60, rel=1e-6)
    assert used['mass_g'] == pytest.approx(1.1 * used['wet_cm3'], rel=1e-9)
    on_part = told['painted_volume_cm3']
    assert used['transfer_efficiency'] == pytest.approx(on_part / (4.0), rel=1e-6)
    assert used['mean_wet_film_um'] == pytest.approx(told['mean_um'] / 0.4, rel=1e-9)
    assert used['spraying_time_s_by_brush'] == pytest.approx({'1': 1.0, '2': 1.0})
    assert told['provenance']['models']['model']['brushes'][1]['number'] == 2


@pytest.mark.slow
def test_a_plan_sprays_with_the_brush_that_is_chosen(model, panel, tmp_path):
    given = ('--mesh', panel, '--model', model, '--speed', 0.4, '--max-edge-length-m', 0.05)
    planned = figures_of('plan', *given, '--brush', 3, '--json', '-o', tmp_path / 'plan')
    assert set(planned['paint']['spraying_time_s_by_brush']) == {'3'}
    (written,) = read_model(tmp_path / 'plan/model.yaml').brushes
    assert written == read_model(model).brushes[2]
    films = []
    for motion, *chosen in (('trajectory',), ('passes.mod', '--model', model)):
        done = ran(
            'simulate', '--mesh', panel, '--trajectory', tmp_path / 'plan' / motion, '--json',
            '--max-edge-length-m', 0.05, *chosen, '-o', tmp_path / 'film',
        )  # fmt: skip
        assert 'planned with another model' not in done.stderr
        films.append(json.loads(done.stdout)['mean_um'])
    assert films[1] == pytest.approx(films[0], rel=2e-3)


@pytest.mark.parametrize(
    ('text', 'brush', 'words'),
    [
        (MODEL, (), 'an index is for one brush and the model has 1, 2, 3: say which (brush)'),
        (MODEL, ('--brush', 8), 'brush 8 is not in the model; its brushes: 1, 2, 3'),
        (
            'effects: []',
            ('--brush', 2),
            'brush 2 is not in the model: it has one pattern, planar, without a',
        ),
    ],
)
def test_an_index_is_for_one_brush_of_the_model(model, tmp_path, text, brush, words):
    model.write_text(text)
    given = ('recommend', '--model', model, '--speed', 0.3, *brush)
    assert_refused(paint(*given, '-o', tmp_path / 'index'), words)
