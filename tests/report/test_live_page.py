"""The live page without ROS: what travels, who may look, runs painted again."""

import json
from threading import Event
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import numpy as np
import pytest

import paint_deposition as pd
from chromium import CHROMIUM, Chromium
from paint_deposition.api.replaying import Replay
from paint_deposition.report.live_page import STEP_UM, Page, Scene

ARRAYS = {'float32': np.float32, 'uint32': np.uint32, 'uint16': np.uint16, 'uint8': np.uint8}


class Onlooker:
    """What a browser makes of its messages."""

    def __init__(self, scene: Scene) -> None:
        self.updates, self.film_um, self.rows, self.kinds = scene.updates(), np.empty(0), {}, []

    def look(self) -> 'Onlooker':
        self.kinds = [self._take(message) for message in next(self.updates)]
        return self

    def _take(self, message: bytes) -> str:
        end = 4 + int.from_bytes(message[:4], 'little')
        head, arrays = json.loads(message[4:end]), {}
        for name, kind, count in head['arrays']:
            arrays[name] = np.frombuffer(message, ARRAYS[kind], count, end)
            end += arrays[name].nbytes
        if head['kind'] == 'part':
            self.film_um = np.zeros(len(arrays['vertices']) // 3)
        elif head['kind'] == 'film':
            mask = np.unpackbits(arrays['changed'], bitorder='little', count=len(self.film_um))
            self.film_um[mask > 0] = arrays['um'].view(np.float16)
        elif head['kind'] == 'rows':
            kept = self.rows.get(head['series'], [])[: head['first']]
            width = 10 if head['series'] == 'history' else 5
            self.rows[head['series']] = kept + arrays['rows'].reshape(-1, width).tolist()
        return head['kind']


@pytest.fixture(scope='module')
def door(repository):
    """The sample door, coarse, and the motion over it."""
    samples = repository / 'ros2_ws/src/paint_deposition/samples'
    motion = pd.read_recording(samples / 'door_horizontal', state_topic='/atomizer/state')
    return pd.read_mesh(samples / 'door.stl', max_edge_length_m=0.05), motion


@pytest.fixture
def scene(door):
    scene = Scene()
    scene.show_part(door[0])
    return scene


@pytest.fixture
def serve(scene):
    """`serve(**options)`: a page on a free port."""
    pages = []

    def serve(**options) -> Page:
        pages.append(Page(scene, port=0, **options))
        return pages[-1]

    yield serve
    for page in pages:
        page.close()


def test_only_what_changed_travels_and_whoever_comes_late_gets_all(scene, door):
    early, late = Onlooker(scene).look(), Onlooker(scene)
    assert early.kinds == ['part']
    random = np.random.default_rng(4)
    film_um = np.zeros(len(door[0].vertices_m))
    for step in range(4):
        some = random.choice(len(film_um), 50, replace=False)
        film_um[some] += random.uniform(0.0, 80.0, 50)
        scene.show_film(film_um)
        scene.move_gun('', np.array([0.1 * step, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), step % 2)
        if step != 2:  # a slow link, on which nothing is lost
            early.look()
            assert set(early.kinds) == {'film', 'guns', 'rows'}
    assert early.look().kinds == []
    late.look()
    for onlooker in (early, late):
        np.testing.assert_allclose(onlooker.film_um, film_um, rtol=2**-11, atol=STEP_UM / 2)
        assert [row[4] for row in onlooker.rows['track']] == [0.0, 1.0, 0.0, 1.0]
    scene.begin_again()
    assert early.look().rows['track'] == []
    assert early.look().kinds == []


def test_a_run_is_painted_as_simulate_paints_it(door):
    surface, motion = door
    film = pd.simulate(surface, motion, target_um=20.0, tolerance_um=3.0)
    wanted = {'rate': 0.0, 'target_um': 20.0, 'tolerance_um': 3.0}
    replay = Replay(surface, [('', motion)], [pd.DepositionModel()], **wanted)
    shown = []
    replay.scene.show_film = shown.append
    replay.paint(Event())
    np.testing.assert_array_equal(shown[-1], film.film_um)
    assert not shown[0].any()
    history = Onlooker(replay.scene).look().rows['history']
    assert history[-1][1:3] == pytest.approx([film.statistics.mean_um, film.statistics.std_dev_um])
    assert history[-1][6] == pytest.approx(film.statistics.within_target)
    assert np.all(np.diff([row[0] for row in history]) > 0.0)


def status(url: str, **headers: str) -> int:
    try:
        return urlopen(Request(url, headers=headers)).status
    except HTTPError as error:
        return error.code


def test_a_page_with_a_token_is_for_those_who_have_it(serve):
    page = serve(token='secret')
    bare = page.url.split('?')[0]
    assert page.url == f'{bare}?token=secret'
    assert status(page.url) == status(bare, Cookie=f'{page.cookie}=secret') == 200
    for path in ('', 'part.js', 'scene', '?token=wrong', 'scene?token=secre'):
        assert status(bare + path) == 403
    assert status(f'{bare}scene?token=secret') == 400


def test_a_page_for_other_machines_gets_a_token_and_one_for_this_machine_hears_its_names(serve):
    assert len(serve(host='0.0.0.0').token) > 20
    page = serve()
    assert page.url.startswith('http://127.0.0.1:')
    assert not page.token
    assert status(page.url) == 200
    assert status(page.url, Host='elsewhere.example') == 403
    assert urlopen(page.url).headers['Content-Security-Policy'].startswith("default-src 'self'")
    with pytest.raises(pd.PaintError, match='in use; choose another port'):
        Page(page.scene, port=int(page.url.split(':')[2].strip('/')))


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason='no Chromium')
def test_a_painted_run_on_a_phone(door, tmp_path):
    surface, motion = door
    film = pd.simulate(surface, motion)
    replay = Replay(surface, [('', motion)], [pd.DepositionModel()], rate=0.0)
    replay.scene.tell('about', text='door.stl')
    replay.paint(Event())
    goes_on = Event()
    page = Page(replay.scene, port=0, command=lambda _: goes_on.wait(60.0))
    try:
        with Chromium(tmp_path / 'browser') as browser:
            tab = browser.tab(page.url, 390, 844)
            tab.wait_until('globalThis.page?.view.film?.some((um) => um > 0)')
            assert tab.evaluate('document.body.scrollWidth') == 390  # nothing is cut off
            said = tab.evaluate("document.getElementById('figures').innerText")
            assert f'{film.statistics.mean_um:.1f} µm' in said
            assert tab.evaluate("document.getElementById('about').innerText") == 'door.stl'

            # The part is compared with readings only later; then it is painted again.
            legend = "document.querySelector('#film .u-legend').innerText.includes('RMS')"
            assert not tab.evaluate(legend)
            replay.scene.add_figures(1e3, film.statistics, rmse_um=0.7)
            tab.wait_until(legend)
            replay.scene.begin_again()
            tab.wait_until("document.getElementById('figures').hidden")

            # The server says no more, and its connection stays open.
            tab.evaluate("document.querySelector('#replay [data-command=pause]').click()")
            off = "document.getElementById('link').classList.contains('off')"
            tab.wait_until(off)
            goes_on.set()
            tab.wait_until(f'!{off}')
    finally:
        goes_on.set()
        page.close()
