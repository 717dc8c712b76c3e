"""What every effect must do, whatever its physics."""

from dataclasses import fields

import numpy as np
import pytest
from numba import float32, njit

import booth
import scenes
from paint_deposition.effects.base import Effect, PathContext
from paint_deposition.effects.catalogue import EFFECTS, FAMILIES
from paint_deposition.effects.learned_curves import CURVES
from paint_deposition.effects.learned_laws import LearnedFootprint
from paint_deposition.files.effect_file import problem_in_words, read_effect_file
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.kernel.eq2_flux import Ray, in_precision
from reference import reference_film_um

ALL = [*EFFECTS.values(), read_effect_file(booth.SAMPLES / 'my_effect.py')]
AMPLITUDES = [(effect, name) for effect in ALL for name in effect.amplitudes()]

WITH_LAW = [e for e in ALL if e.flux_factor is not None or e.pattern_scale is not None]
LEARNED_LAWS = [law for law in CURVES.values() if law.flux_factor is not None]
UNIT_SUFFIXES = {
    'm': '_m', 's': '_s', 'rad': '_rad', 'um': '_um', '1/pass': '_per_pass',
    '1/(m/s)': '_per_m_per_s', 'm/m': '_m_per_m', '1': '',
}  # fmt: skip
# What has a kernel of its own takes seconds to compile.
COMPILED = [*WITH_LAW, LearnedFootprint, EFFECTS['occlusion']]


def case(effect: type[Effect], *more: str):
    """The parameters of a test of this effect."""
    marks = pytest.mark.slow if effect in COMPILED else ()
    return pytest.param(effect, *more, id='-'.join([effect.id, *more]), marks=marks)


# Two passes over the panel, the gun opening and closing on it.
PASSES = booth.path_of(booth.serpentine((0.08, -0.08)))
EFFECT = pytest.mark.parametrize('effect', [case(effect) for effect in ALL])
AMPLITUDE = pytest.mark.parametrize(('effect', 'name'), [case(*one) for one in AMPLITUDES])


@EFFECT
def test_it_says_what_it_is_and_every_parameter_its_unit_bounds_and_size(effect):
    assert effect.__doc__
    assert effect.family
    assert effect.signature
    assert effect.amplitudes()
    if effect.file is None:
        assert effect.source
        assert effect.family in FAMILIES
        assert set(effect.rivals) <= set(EFFECTS) - {effect.id}
        assert all(effect.id in EFFECTS[rival].rivals for rival in effect.rivals)
        assert problem_in_words(effect) is None
    for name, described in effect.parameters().items():
        assert name.endswith(UNIT_SUFFIXES[described['unit']]), name
        assert described['low'] <= described['neutral'] < described['high']
        assert described['low'] <= described['typical'] <= described['high']
        assert described['description'].endswith(f'[{described["unit"]}]')
        if described['role'] == 'amplitude':
            assert described['typical'] != described['neutral']
            assert 'positive' in described['description']


@EFFECT
def test_neutral_changes_nothing(effect: type[Effect]):
    points, neutral = booth.door().points(), effect()
    film = np.linspace(0.0, 30.0, len(points))
    context = PathContext(booth.MODEL.projection, points.down, points.outward, points.centre_m)
    assert np.array_equal(neutral.on_film(film, points), film)
    assert np.array_equal(neutral.on_gauge(film, points), film)
    path = neutral.on_path(PASSES, context)
    for column in fields(PASSES):
        before, after = getattr(PASSES, column.name), getattr(path, column.name)
        np.testing.assert_allclose(after, before, rtol=1e-14, atol=1e-14, err_msg=column.name)
    film_of, base = (booth.painted(booth.door(), PASSES, *e) for e in ((neutral,), ()))
    assert neutral.is_neutral
    assert np.array_equal(film_of.gauge_um, base.gauge_um)
    for law in (effect.flux_factor, effect.pattern_scale):
        if law is not None:
            assert law(Ray(0.1, 0.2, 1.7, 0.6, 0.4), *neutral.values()) == 1.0
    assert neutral.widening() == 1.0
    assert neutral.shadow() == 0.0


@EFFECT
def test_the_film_is_finite_and_flux_is_never_negative(effect: type[Effect]):
    for end in ('low', 'high'):
        extreme = effect(**{name: at[end] for name, at in effect.parameters().items()})
        film = booth.painted(booth.door(), PASSES, extreme)
        assert np.isfinite(film.gauge_um).all()
        assert film.raw_um.min() >= 0.0


@AMPLITUDE
def test_the_film_follows_the_amplitude_smoothly(effect: type[Effect], name: str):
    described = effect.parameters()[name]
    neutral, step = described['neutral'], 1e-3 * described['typical']
    surface = booth.panel_with_screen() if effect.id == 'occlusion' else booth.door()

    def slope(before: float, after: float) -> np.ndarray:
        acting = (effect(**{name: value}) for value in (before, after))
        low, high = (booth.painted(surface, PASSES, one).gauge_um for one in acting)
        return (high - low) / (after - before)

    forward = slope(neutral, neutral + step)
    two_sided = described['low'] < neutral
    other = slope(neutral - step, neutral) if two_sided else slope(neutral, neutral + 0.5 * step)
    scale = np.linalg.norm(forward)
    assert scale > 0.0
    # One kernel's rounding against another's: shadows are another kernel.
    assert np.linalg.norm(forward - other) <= 0.02 * scale + 1e-8


@pytest.mark.parametrize('effect', [case(effect) for effect in (*WITH_LAW, LearnedFootprint)])
def test_the_kernel_computes_the_law(effect: type[Effect]):
    points = booth.door().points().select(slice(None, None, 7))
    path = booth.path_of(booth.serpentine((0.45,), half_width_m=0.2, opens_at_m=0.1))
    model = booth.MODEL.with_effect(effect.typical())
    film_um = scenes.painted(points, path, model, 'double').raw_um
    expected = reference_film_um(points, path, model)
    np.testing.assert_allclose(film_um, expected, rtol=0.0, atol=2e-9 * expected.max())


@pytest.mark.slow
@pytest.mark.parametrize('effect', [*WITH_LAW, *LEARNED_LAWS], ids=lambda effect: effect.id)
def test_the_law_stays_in_single_precision(effect: type[Effect]):
    """One number of double precision would carry the whole loop of the kernel into it."""
    ray = Ray(*np.array([0.1, 0.2, 1.7, 0.6, 0.4], np.float32))
    values = np.array(effect.typical().values(), np.float32)
    for law in filter(None, (effect.flux_factor, effect.pattern_scale)):
        compiled = njit(in_precision(law, np.float32))
        assert compiled(ray, *values) == pytest.approx(law(ray, *values), rel=1e-6)
        (signature,) = compiled.nopython_signatures
        assert signature.return_type == float32


@EFFECT
def test_a_stream_paints_what_the_recording_does(effect: type[Effect]):
    trajectory = booth.serpentine((0.05, -0.05), half_width_m=0.3, opens_at_m=0.2)
    model = booth.MODEL.with_effect(effect.typical())
    whole = booth.painted(booth.panel(0.3, 0.05), trajectory, effect.typical())
    part = booth.panel(0.3, 0.05)
    live = FilmIntegrator(part.points(), model, 'double', part, parallel=False)
    for piece in scenes.streamed(trajectory, [7], model.needs_whole_strokes)[0]:
        live.add(piece)
    assert np.array_equal(live.gauge_um, whole.gauge_um)
    assert live.used.emitted_cm3 == pytest.approx(whole.used.emitted_cm3, rel=1e-12)


@EFFECT
def test_readings_are_predicted_as_the_surface_they_lie_on(effect: type[Effect]):
    sheet = booth.painted(booth.door(), PASSES, effect.typical()).gauge_um
    some = slice(11, None, 97)
    stencil_m = 0.01 if effect.needs_slope else None
    at = booth.door().at(booth.door().vertices_m[some], booth.door().normals[some], stencil_m)
    model = booth.MODEL.with_effect(effect.typical())
    integrator = FilmIntegrator(at, model, 'double', booth.door(), parallel=False)
    integrator.add(PASSES)
    readings = integrator.gauge_um[: len(sheet[some])]
    # A stencil sees more than the triangles around a vertex.
    tolerance = 0.02 if effect.needs_slope else 1e-6
    np.testing.assert_allclose(readings, sheet[some], rtol=0, atol=tolerance * sheet.max())


def test_an_effect_that_is_replaced_keeps_its_place():
    fog, gain = EFFECTS['overspray_fog'].typical(), EFFECTS['edge_build'].typical()
    model = booth.MODEL.with_effect(fog).with_effect(gain).with_effect(fog.absent)
    assert model.effects == (fog.absent, gain)


@pytest.mark.slow
def test_laws_multiply():
    points = booth.door().points().select(slice(None, None, 7))
    path = booth.path_of(booth.spot(z_m=0.45, standoff_m=0.35))
    chosen = [effect.typical() for effect in WITH_LAW]
    model = booth.MODEL.model_copy(update={'effects': tuple(chosen)})
    film_um = scenes.painted(points, path, model).raw_um
    expected = reference_film_um(points, path, model)
    np.testing.assert_allclose(film_um, expected, rtol=0.0, atol=3e-6 * expected.max())
