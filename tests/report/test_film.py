"""The pictures of a painted part and of profiles, and names from files that are never run."""

import csv
import io
import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread

import paint_deposition as pd
from booth import door, panel, serpentine
from paint_deposition.files.gauge_readings import write_table
from paint_deposition.film.statistics import film_statistics
from paint_deposition.inference.comparison.comparison import compare
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import Experiment
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.report.colour_scales import BELOW, HIGH, WITHIN
from paint_deposition.report.data import ReportData
from paint_deposition.report.drawing import PartPicture, View, save_picture
from paint_deposition.report.film_pictures import film_picture
from paint_deposition.report.page import report_html
from paint_deposition.report.readings_pictures import comparison_figure
from report.web_page import Page
from small_campaign import small_campaign
from surfaces import triangulated

X, Y, Z = np.eye(3)


@pytest.mark.parametrize(
    ('outward', 'down', 'right', 'labels'),
    [
        (-Y, -Z, X, ('x [m]', 'z [m]')),
        (Y, -Z, -X, ('x [m]', 'z [m]')),
        (X, -Z, Y, ('y [m]', 'z [m]')),
        (Z, -Y, X, ('x [m]', 'y [m]')),
        (Z, -Z, X, ('x [m]', 'y [m]')),
        # A part overhead has the same right side in words and in the picture: see across_axis.
        (-Z, -Z, X, ('x [m]', 'y [m]')),
        # A hood that falls toward -x has its front below.
        (Z * 0.98 - X * 0.2, -Z, -Y, ('y [m]', 'x [m]')),
        (-Y * 0.97 + Z * 0.24, -Z, X, ('x [m]', 'z [m]')),
    ],
)
def test_the_view_is_the_guns(outward, down, right, labels):
    view = View.of_front(np.array(outward, dtype=float), np.array(down, dtype=float))
    assert np.allclose(view.right, right)
    assert view.labels == labels
    axes = np.stack([view.right, view.up, view.toward])
    assert np.allclose(axes @ axes.T, np.eye(3))
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert view.up @ down <= 1e-9


def figure_of(surface, film_um, path=None, **target):
    statistics = film_statistics(film_um, surface.vertex_areas_m2, 10.0, **target)
    spray = SprayPath.empty() if path is None else path
    return film_picture(surface, film_um, spray, statistics, 'Part', '')


def pixels_of(figure) -> np.ndarray:
    """(H, W, 3) the picture, first row on top."""
    content = io.BytesIO()
    figure.savefig(content, format='png', dpi=figure.dpi)
    content.seek(0)
    return (255 * imread(content)[:, :, :3]).round().astype(int)


def colour_bar(figure, pixels) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) colours of the bar from below, and the film [um] that its axis has there."""
    bar = figure.axes[1]
    box = bar.get_window_extent()
    rows = np.arange(int(box.y0) + 2, int(box.y1) - 1)
    film = bar.transData.inverted().transform(np.stack([np.zeros(len(rows)), rows + 0.5], 1))[:, 1]
    return pixels[len(pixels) - 1 - rows, int(box.x0 + 0.5 * box.width)], film


@pytest.mark.slow
def test_the_film_is_read_back_from_the_picture_through_its_colour_bar():
    surface = door()
    # Thin to thick along a slant, on a door whose creases any light would show.
    x, z = surface.vertices_m[:, 0], surface.vertices_m[:, 2]
    film = 18.0 + 9.0 * x + 6.0 * z
    figure = figure_of(surface, film)
    pixels = pixels_of(figure)
    colours, films = colour_bar(figure, pixels)
    inside = surface.normals @ surface.outward > 0.9
    at = figure.axes[0].transData.transform(np.stack([x, z], axis=1)[inside]).astype(int)
    centre = figure.axes[0].transData.inverted().transform(at + 0.5)
    true_um = 18.0 + 9.0 * centre[:, 0] + 6.0 * centre[:, 1]
    seen = pixels[len(pixels) - 1 - at[:, 1], at[:, 0]]
    off = np.abs(seen[:, None] - colours[None]).sum(axis=2)
    # Colours between those of the vertices; elsewhere a contour or the outline lies on top.
    clear = off.min(axis=1) <= 6
    assert clear.mean() > 0.9
    # Where several rows of the bar have the colour, it is read in their middle.
    same = off == off.min(axis=1, keepdims=True)
    read_um = (same @ films) / same.sum(axis=1)
    assert np.abs(read_um / true_um - 1.0)[clear].max() < 0.03


@pytest.mark.slow
def test_the_bands_take_the_share_of_the_picture_that_the_figures_tell():
    surface = panel()
    film = 20.0 + 20.0 * surface.vertices_m[:, 0]
    target = {'target_um': 18.0, 'target_tolerance_um': 3.0}
    figure = figure_of(surface, film, **target)
    pixels, box = pixels_of(figure), figure.axes[0].get_window_extent()
    rows = slice(len(pixels) - int(box.y1), len(pixels) - int(box.y0))
    area = pixels[rows, int(box.x0) : int(box.x1)]
    bands = (np.round(255 * np.array(to_rgb(colour))) for colour in (BELOW, WITHIN, HIGH))
    counts = [np.sum(np.abs(area - band).sum(axis=2) < 4) for band in bands]
    # From 10 to 30 um across the panel: 15 and 21 um lie a quarter and eleven twentieths along.
    assert np.array(counts) / sum(counts) == pytest.approx([0.25, 0.3, 0.45], abs=0.005)
    legends = filter(None, (axes.get_legend() for axes in figure.axes))
    told = ' '.join(text.get_text() for legend in legends for text in legend.get_texts())
    told_percent = [float(share) for share in re.findall(r'([\d.]+) %', told)]
    # The figures count whole vertices, here 20 mm apart.
    assert told_percent == pytest.approx([45.0, 30.0, 25.0], abs=2.0)
    assert sum(told_percent) == pytest.approx(100.0, abs=0.2)


@pytest.mark.slow
@pytest.mark.parametrize(('suffix', 'begins'), [('svg', b'<?xml'), ('pdf', b'%PDF')])
def test_the_suffix_is_the_format(tmp_path, suffix, begins):
    picture = figure_of(panel(), np.zeros(len(panel().vertices_m)))
    assert save_picture(picture, tmp_path / f'film.{suffix}').read_bytes().startswith(begins)


@pytest.mark.parametrize(('height_m', 'whole'), [(0.9, True), (50.0, False)])
def test_passes_beside_the_part_are_drawn_whole_and_those_far_off_left_out(height_m, whole):
    path = spray_path(serpentine((0.5, height_m), half_width_m=1.2, opens_at_m=1.1))[0]
    gun = path.position_m[path.flow > 0.0]
    figure = figure_of(door(), np.zeros(len(door().vertices_m)), path)
    (left, right), (low, high) = figure.axes[0].get_xlim(), figure.axes[0].get_ylim()
    assert left < gun[:, 0].min() < gun[:, 0].max() < right
    assert (low < gun[:, 2].min() < gun[:, 2].max() < high) == whole
    assert high - low < 3.0


def folded(spacing_m):
    return triangulated(lambda x, z: 0.2 * x**2 + 0.9 * np.abs(z - 0.03), spacing_m, jitter=0.2)


def test_what_is_seen_is_drawn_over_what_it_hides_and_edges_are_outline_and_fold():
    vertices, faces = folded(0.02)
    behind = vertices + np.array([0.15, 0.4, 0.05])
    both = np.concatenate([faces, faces + len(vertices)])
    surface = pd.Surface.from_triangles(np.concatenate([vertices, behind]), both, 0.05)
    picture = PartPicture.of(surface)
    assert 0.5 < picture.seen.mean() < 0.9
    middle = surface.vertices_m[picture.faces].mean(axis=1)
    eyes = middle[picture.seen] + 2.0 * picture.view.toward
    met = surface.first_faces(eyes, -np.tile(picture.view.toward, (len(eyes), 1)))
    drawn = {tuple(face): row for row, face in enumerate(picture.faces.tolist())}
    rows = np.array([drawn[tuple(face)] for face in surface.faces[met].tolist()])
    assert (rows == np.flatnonzero(picture.seen)).all()
    far = (middle @ picture.view.toward)[~picture.seen]
    assert far.max() < (middle @ picture.view.toward)[picture.seen].max()
    vertices, faces = folded(0.01)
    picture = PartPicture.of(pd.Surface.from_triangles(vertices, faces, 0.05))
    assert 0 < len(picture.edges_m) < 400


@pytest.mark.slow
def test_thicker_columns_are_not_cut_off_by_a_thin_one(tmp_path):
    study = Study.of(small_campaign(tmp_path, experiments=('door',), style='columns'))
    data = ReportData(compare(study, pd.DepositionModel()))
    thin = data.profiles[0]
    thick = replace(thin, lines_um=2.0 * thin.lines_um)
    vars(data)['profiles'] = [thin, thick]
    figure = comparison_figure(data)
    tops_um = [film.get_ylim()[1] for film in figure.axes[::2]]
    assert tops_um[0] == tops_um[1] > np.max(thick.lines_um[0])
    none = {'line_m': np.empty(0), 'lines_um': np.empty((1, 0)), 'passes_um': np.empty((0, 0))}
    vars(data)['profiles'] = [replace(thin, **none)]
    assert len(comparison_figure(data).axes) == 2


HOSTILE = '</script><script>alert(1)</script><img src=x onerror="alert(2)">\'"'


@pytest.mark.parametrize(
    'name', ["=cmd|' /C calc'!A0", '+1+1', '-2+3', '@SUM(A1)', '-P1', '=1,"2"', '\t=1', 'a;=1']
)
def test_a_name_is_no_formula_in_a_table_and_comes_back_as_it_was(name, tmp_path):
    rows = [['point', 'x_m', 'y_m', 'z_m', 'thickness_um'], [name, '-0.1', '+0.2', '1e-3', '20']]
    write_table(tmp_path / 'readings.csv', rows)
    with (tmp_path / 'readings.csv').open(newline='') as file:
        _, cells = csv.reader(file)
    assert cells == [f"'{name}" if name[0] != 'a' else "a;'=1", *rows[1][1:]]
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
        return report_html(ReportData(compare(study, pd.DepositionModel())))

    plain, hostile = page('door'), page(HOSTILE)
    assert '&lt;script&gt;alert(1)' in hostile
    assert HOSTILE not in hostile
    assert runs(hostile) == runs(plain)


def runs(page: str) -> tuple[int, list[str]]:
    """What runs when a page is opened: the number of its scripts, and its handlers."""
    elements = Page(page).elements
    handlers = [name for _, has in elements for name in has if name.startswith('on')]
    return sum(tag == 'script' for tag, _ in elements), handlers
