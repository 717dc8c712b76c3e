"""The integral: what it does not depend on, its terms, and shadows on it."""

import math
from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from trimesh.creation import box
from trimesh.transformations import translation_matrix
from trimesh.util import concatenate

import paint_deposition as pd
import scenes
from booth import LOOKING_ALONG_Y
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.errors import ModelError
from paint_deposition.film.integrator import FilmIntegrator, after_effects
from paint_deposition.film.layout import SIGHT_STEP_M, emission_points_m, term_weights
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.visibility import sees
from patterns import PATTERNS
from scenes import lying_plane, stamps_ns, straight_pass, weaving

MODEL = pd.DepositionModel()


painted = partial(scenes.painted, precision='double')


def largest_error(film, expected):
    return np.abs(film - expected).max() / expected.max()


# The weaving way at 0.3 m/s with a tool that sways, as a robot's log may show it.
DURATION_S = 4.0


def sampled_evenly(period_s):
    return weaving(np.linspace(0.0, DURATION_S, round(DURATION_S / period_s) + 1))


def sampled_unevenly():
    """Intervals from 1 to 24 ms; now and then the last pose comes again under a new stamp."""
    rng = np.random.default_rng(11)
    times = np.cumsum(rng.uniform(0.001, 0.024, 1000))
    times = np.concatenate([[0.0], times[times < DURATION_S], [DURATION_S]])
    log = weaving(times)
    early = np.append(np.diff(times, prepend=-1.0)[1:-1] < 0.004, False)
    again = 1 + np.flatnonzero(early & (rng.random(len(times) - 1) < 0.3))
    positions, quaternions = log.positions_m.copy(), log.quaternions_xyzw.copy()
    positions[again], quaternions[again] = positions[again - 1], quaternions[again - 1]
    assert len(again) > 5
    return pd.Trajectory(log.stamps_ns, positions, quaternions)


@pytest.fixture(scope='module')
def exact():
    """The film of the weaving way, integrated 80 times finer, and where."""
    points = lying_plane(0.6, 25)
    path, _ = spray_path(sampled_evenly(0.0005), max_step_m=0.0001)
    return points, painted(points, path).film_um


@pytest.mark.parametrize(
    ('trajectory', 'limit'),
    [(sampled_evenly(0.02), 1e-3), (sampled_evenly(0.001), 1e-4), (sampled_unevenly(), 1e-3)],
    ids=['50 Hz', '1 kHz', '1 to 24 ms with repeats'],
)
@pytest.mark.parametrize('precision', ['single', 'double'])
def test_the_film_does_not_depend_on_the_sampling(trajectory, limit, precision, exact):
    points, expected = exact
    path, _ = spray_path(trajectory, max_step_m=MODEL.max_step_m)
    assert largest_error(painted(points, path, precision=precision).film_um, expected) < limit


@pytest.mark.parametrize(
    'planar',
    [
        PlanarPattern(),
        PlanarPattern(r_m=0.05, sigma1_m=0.02, sigma2_m=0.03),
        PlanarPattern(r_m=0.1, sigma1_m=0.04, sigma2_m=0.2, K3=1.0, K2=0.0),
    ],
)
@pytest.mark.parametrize('standoff_m', [0.25, 0.4])
def test_sub_steps_are_fine_enough(planar, standoff_m):
    """One segment of a whole pass with the gun opening and closing on it, cut by itself."""
    model, ends = pd.DepositionModel(planar=planar), ((-0.3, 0, standoff_m), (0.3, 0, standoff_m))
    changes, flow = stamps_ns([0.0, 0.6101, 1.4]), np.array([0.0, 1.0, 0.0])
    pass_ = straight_pass([0.0, 2.0], *ends, trigger_stamps_ns=changes, trigger_flow=flow)
    coarse, fine = (spray_path(pass_, 5.0, model.max_step_m / finer)[0] for finer in (1, 40))
    # The middle row lies on the line that the axis draws, where eq. (1) jumps at the centre.
    points = lying_plane(0.4, 31)
    expected = painted(points, fine, model).film_um
    assert largest_error(painted(points, coarse, model).film_um, expected) < 1e-3


def test_the_film_is_in_proportion_to_flow_k1_and_time():
    points, path = lying_plane(count=21), spray_path(straight_pass(np.arange(0.0, 2.0, 0.02)))[0]
    plain = painted(points, path).film_um
    less = painted(points, path.with_(flow=0.37 * path.flow)).film_um
    assert largest_error(less, 0.37 * plain) < 1e-12
    more = pd.DepositionModel(planar=PlanarPattern(K1_cm3_per_s=3 * MODEL.planar.K1_cm3_per_s))
    assert largest_error(painted(points, path, more).film_um, 3.0 * plain) < 1e-12
    slow = painted(points, straight_pass(np.linspace(0.0, 4.0, 401))).film_um
    fast = painted(points, straight_pass(np.linspace(0.0, 2.0, 401))).film_um
    assert largest_error(slow, 2.0 * fast) < 1e-12


class Broken(EFFECTS['sag']):
    """A user's law that fails on bare metal."""

    def on_film(self, film_um, points):
        return film_um * (film_um / film_um)

    def on_gauge(self, film_um, points):
        return np.where(film_um > 0.0, np.inf, film_um)


def test_a_film_is_finite_and_nobody_changes_it():
    points, path = lying_plane(count=21), spray_path(straight_pass(np.arange(0.0, 2.0, 0.02)))[0]
    film_um = painted(points, path).film_um
    with pytest.raises(ValueError, match='read-only'):
        film_um += 1.0
    broken, bare = [Broken.typical()], np.zeros(len(points))
    nowhere = "'sag' gives a film of nan µm at"
    with np.errstate(all='ignore'), pytest.raises(ModelError, match=nowhere):
        after_effects('on_film', bare, broken, points)
    with pytest.raises(ModelError, match="'sag' gives a reading of inf µm at 441 of 441 points"):
        after_effects('on_gauge', film_um, broken, points)


def test_moving_part_and_gun_together_changes_nothing():
    points = lying_plane(count=25)
    log = weaving(np.arange(0.0, 2.0, 0.02))
    turn, shift = Rotation.from_euler('xyz', [0.5, -1.2, 2.8]), np.array([4.0, -3.0, 1.5])
    moved = SurfacePoints(turn.apply(points.positions_m) + shift, turn.apply(points.normals))
    turned = (turn * Rotation.from_quat(log.quaternions_xyzw)).as_quat()
    moved_log = pd.Trajectory(log.stamps_ns, turn.apply(log.positions_m) + shift, turned)
    still = painted(points, log).film_um
    assert largest_error(painted(moved, moved_log).film_um, still) < 1e-9
    single = painted(moved, moved_log, precision='single').film_um
    assert largest_error(single, still) < 2e-6


CASES = [*((planar, ()) for planar in PATTERNS.values()), (PlanarPattern(), ('pattern_spread',))]
# Of the film's peak: what lies beyond the reach of one or the other.
CUT = 3e-6


def integrator_of(model: pd.DepositionModel) -> FilmIntegrator:
    return FilmIntegrator(lying_plane(count=13), model, 'double', parallel=False)


def film_um(model: pd.DepositionModel) -> np.ndarray:
    integrator = integrator_of(model)
    integrator.add(PATH)
    return integrator.raw_um


PATH = spray_path(weaving(np.arange(0.0, 2.0, 0.05)))[0]


def moved(p: PlanarPattern, parameter: int, step: float) -> PlanarPattern:
    """The pattern with one of the parameters of ``term_weights`` moved."""
    lopsided = [p.K3 * math.cos(p.phi_rad), p.K3 * math.sin(p.phi_rad)]
    if parameter in (2, 3):
        lopsided[parameter - 2] += step
    factors = {
        0: ('K1_cm3_per_s', p.K1_cm3_per_s * math.exp(step)), 1: ('K2', p.K2 + step),
        4: ('r_m', p.r_m + step), 5: ('sigma1_m', p.sigma1_m * math.exp(step)),
        6: ('sigma2_m', p.sigma2_m * math.exp(step)),
    }  # fmt: skip
    change = dict([factors[parameter]]) if parameter in factors else {}
    asymmetry = {'K3': math.hypot(*lopsided), 'phi_rad': math.atan2(*lopsided[::-1])}
    return p.model_copy(update={**asymmetry, **change})


@pytest.mark.parametrize(('planar', 'effects'), CASES, ids=[*PATTERNS, 'pattern spread'])
def test_the_terms_add_up_to_the_film_and_to_its_derivatives(planar, effects):
    effects = tuple(EFFECTS[name].typical() for name in effects)
    model = pd.DepositionModel(planar=planar, effects=effects)
    (of_film, weights), integrator = term_weights(planar), integrator_of(model)
    terms, film = integrator.terms(integrator.steps(PATH)), film_um(model)
    peak = film.max()
    assert peak > 1.0
    assert of_film @ terms == pytest.approx(film, rel=0, abs=CUT * peak)
    found = weights @ terms
    for parameter, derivative in enumerate(found):
        if parameter == 1 and planar.K2 in (0.0, 1.0):
            continue  # see the test below
        patterns = (moved(planar, parameter, step) for step in (-1e-4, 1e-4))
        low, high = (film_um(model.with_patterns([pattern])) for pattern in patterns)
        slope = (high - low) / 2e-4
        scale = max(np.abs(slope).max(), peak)
        assert derivative == pytest.approx(slope, rel=0, abs=1e-4 * scale), parameter


OPEN = pd.DepositionModel(planar=PlanarPattern(K1_cm3_per_s=1.3, r_m=0.05, sigma1_m=0.03))
SHADED = OPEN.with_effect(EFFECTS['occlusion'](strength=0.8))


@pytest.fixture(scope='module')
def tray():
    """A box open to the gun, with a bar across it."""
    walls = [
        box((0.8, 0.01, 0.5)),
        *(box((0.8, 0.12, 0.01), translation_matrix([0.0, -0.06, z])) for z in (-0.25, 0.25)),
        *(box((0.01, 0.12, 0.5), translation_matrix([x, -0.06, 0.0])) for x in (-0.4, 0.4)),
        box((0.03, 0.03, 0.5), translation_matrix([0.05, -0.1, 0.0])),
    ]
    whole = concatenate(walls)
    return pd.Surface.from_triangles(whole.vertices, np.asarray(whole.faces), 0.03)


@pytest.fixture(scope='module')
def path():
    ends = (-0.5, -0.3, 0.1), (0.5, -0.25, -0.1)
    log = straight_pass(np.linspace(0, 1.5, 76), *ends, LOOKING_ALONG_Y)
    return spray_path(log, max_step_m=OPEN.max_step_m)[0]


def traced_everywhere(surface, path):
    """The film sub-step by sub-step, all points traced, and how much the shadows take."""
    origins = emission_points_m(SHADED, path)
    film, open_film, eye = 0.0, 0.0, np.full(3, np.inf)
    step = FilmIntegrator(surface.points(), OPEN, 'double')
    for row, origin in enumerate(origins):
        if np.linalg.norm(origin - eye) > SIGHT_STEP_M:
            eye = origin
            seen = sees(surface.obstacle, eye, surface.vertices_m)
        step.reset()
        step.add(path.select(slice(row, row + 1)))
        film, open_film = film + step.film_um * (1.0 - 0.8 * ~seen), open_film + step.film_um
    return film, 1.0 - film.sum() / open_film.sum()


def test_the_film_is_that_of_all_points_traced(tray, path):
    expected, lost = traced_everywhere(tray, path)
    assert 0.05 < lost < 0.5
    for at_once in (10_000, 7):
        film = FilmIntegrator(tray.points(), SHADED, 'double', tray)
        for start in range(0, len(path), at_once):
            film.add(path.select(slice(start, start + at_once)))
        # Beyond the pattern's reach, where the flux is a millionth of the peak, nothing is traced.
        assert np.abs(film.film_um - expected).max() < 1e-6 * expected.max()


def test_a_prepared_path_serves_a_wider_pattern(tray, path):
    wide = SHADED.model_copy(update={'planar': PlanarPattern(r_m=0.2, sigma1_m=0.09)})
    prepared = FilmIntegrator(tray.points(), SHADED, 'double', tray)
    steps = prepared.steps(path)
    prepared.use(wide)
    prepared.paint(steps)
    film = painted(tray.points(), path, wide, occluder=tray)
    assert np.abs(prepared.film_um - film.film_um).max() < 1e-5 * film.film_um.max()
