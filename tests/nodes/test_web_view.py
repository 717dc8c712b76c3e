"""The page of a running cell: what browsers see is what the simulator painted."""

import numpy as np
import pytest

from chromium import CHROMIUM, Chromium
from nodes.cell import two_passes, write_panel
from paint_deposition.nodes.node import WARN
from paint_deposition.nodes.web_view import WebView
from paint_deposition.report.colour_scales import film_scale
from paint_deposition.report.live_page import STEP_UM, Page, Scene

# Of a vertex the colour that is drawn, without gun and passes in front of it.
COLOUR = """(() => {
  const { view } = page, gl = view.renderer.getContext();
  view.guns.visible = view.track.visible = false;
  view.renderer.render(view.scene, view.camera);
  const { array } = view.mesh.geometry.attributes.position;
  const place = view.pin.position.clone().fromArray(array, 3 * VERTEX);
  const [x, y] = view.project(place), box = view.canvas.getBoundingClientRect();
  const pixel = new Uint8Array(4);
  gl.readPixels(x - box.left, box.bottom - y, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
  view.canvas.dispatchEvent(new PointerEvent('pointermove', { clientX: x, clientY: y }));
  return [...pixel.slice(0, 3), parseFloat(document.querySelector('#probe b').innerText)];
})()"""


def is_bare(scene: Scene) -> bool:
    """Whether a browser that comes now is sent no film."""
    return not any(b'"kind": "film"' in message for message in next(scene.updates()))


@pytest.fixture
def web_view(closed, tmp_path):
    """`web_view(**parameters)`: the page's node, beside a simulator of the panel."""
    panel = {'mesh_file': str(write_panel(tmp_path / 'panel.stl')), 'max_edge_length_m': 0.05}
    return lambda **values: closed(WebView, **panel | {'port': 0} | values)


@pytest.mark.skipif(CHROMIUM is None, reason='no Chromium')
def test_browsers_see_the_film_of_the_simulator(
    simulator, web_view, robot, painted, executor, wait_until, tmp_path
):
    target = {'target_um': 10.0, 'target_tolerance_um': 2.0}
    painter, viewer = simulator(**target), web_view(**target)
    motion = two_passes()
    from_robot = robot(painter, viewer)

    def shows(tab, film_um) -> bool:
        shown = np.array(tab.evaluate('Array.from(page.view.film ?? [])'))
        within = {'rtol': 2**-11, 'atol': STEP_UM / 2}
        return len(shown) == len(film_um) and np.allclose(shown, film_um, **within)

    with Chromium(tmp_path / 'browser') as browser:
        early = browser.tab(viewer.page.url)
        early.wait_until('globalThis.page?.view.film')
        from_robot.send(motion)
        film_um = painted(painter)
        late = browser.tab(viewer.page.url, 390, 844)
        late.wait_until('globalThis.page')
        for tab in (early, late):
            wait_until(lambda tab=tab: shows(tab, film_um), what='the film in the browser')
        at = painter.surface.vertices_m
        colours = film_scale(film_um).rgba(film_um, film_um > 1.0)
        inside = np.flatnonzero(np.abs(at[:, [0, 2]]).max(axis=1) < 0.35)
        for vertex in inside[np.argsort(film_um[inside])[[5, len(inside) // 2, -1]]]:
            *colour, probed = early.evaluate(COLOUR.replace('VERTEX', str(vertex)))
            assert probed == pytest.approx(film_um[vertex], abs=0.15)
            # What does not face the eye is a little darker.
            shade = np.array(colour) / colours[vertex, :3]
            assert 0.9 < shade.max() < 1.06
            np.testing.assert_allclose(colour, shade.mean() * colours[vertex, :3], atol=8)
        assert early.evaluate('page.view.segments') > 50
        assert early.evaluate('page.state.history.length') >= 1
        assert 'within target' in early.evaluate("document.getElementById('figures').innerText")

        # The simulator is silent, and goes on.
        executor.remove_node(painter)
        silent = (
            "(e => e.classList.contains('off') && e.textContent.includes('no word of'))"
            "(document.getElementById('link'))"
        )
        wait_until(lambda: early.evaluate(silent), what='the doubt in the browser')
        executor.add_node(painter)
        wait_until(lambda: not early.evaluate(silent), what='the simulator again')

        # The server goes away and comes back; the film went on meanwhile.
        port = int(viewer.page.url.split(':')[2].strip('/'))
        viewer.page.close()
        early.wait_until("document.getElementById('link').classList.contains('off')")
        painter.reset()
        wait_until(lambda: is_bare(viewer.scene), what='the bare part')
        viewer.page = Page(viewer.scene, port=port)
        wait_until(lambda: shows(early, 0.0 * film_um), what='the bare part in the browser')
        assert early.evaluate('page.view.segments') == 0


def test_another_mesh_shows_no_film(simulator, web_view, onlooker, robot, painted, wait_until):
    painter, viewer, looker = simulator(), web_view(max_edge_length_m=0.1), onlooker()
    robot(painter, viewer).send(two_passes(60))
    painted(painter, 60)
    told = 'is not on'
    wait_until(lambda: looker.reports('web_view: page', told, WARN), what='the remedy')
    assert is_bare(viewer.scene)
