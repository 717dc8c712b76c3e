"""The part in 3D: film, residual before and after, spray passes, points to measure.

The mesh is kept once; traces name the geometry that the page's script hands to them.
"""

from typing import Any

import numpy as np

from paint_deposition.comparison.residual_field import spread_over_surface
from paint_deposition.film.colour_scales import round_up
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.axes import across_axis, downhill_axis
from paint_deposition.part.surface import Surface
from paint_deposition.readings.campaign import Experiment
from paint_deposition.report.data import ReportData
from paint_deposition.report.page.layout import FILM_COLOURS, RESIDUAL_COLOURS, base_layout
from paint_deposition.report.style import ACCENT, INK, MUTED

SURFACE = '#c3c9cf'
# Few readings beyond the end of the colours do not take the contrast from all others.
SHOWN_SHARE = 0.98
POINTS_A_PASS = 60
RESIDUAL = 'measured minus predicted [µm]'
# Marks float this far above the surface, so that it does not swallow half of them [m].
LIFT_M = 0.008
# Bare surface shows its relief; film and residual have the colours of their scale.
SHADED = {'ambient': 0.9, 'diffuse': 0.35, 'specular': 0.0, 'roughness': 1.0, 'fresnel': 0.0}
TRUE_COLOURS = SHADED | {'ambient': 1.0, 'diffuse': 0.2}
# Plotly's camera sees 45 deg from bottom to top.
TAN_HALF_VIEW, ROOM_AROUND = float(np.tan(np.pi / 8.0)), 1.06
PANE_ASPECT = 1.36
# A part whose outward side leans less toward the vertical than this is looked at upright.
STANDING = 0.98


def scene_data(data: ReportData, index: int) -> dict[str, Any]:
    """Geometry, traces and views of one experiment.

    Each trace has ``views``, those in which it is shown, and ``geometry``, the faces it has.
    """
    experiment, rows = data.experiments[index], data.rows_of(index)
    points, surface = experiment.points, experiment.surface
    count = len(experiment)
    positions, normals = points.positions_m[:count], points.normals[:count]
    fields = [spread_over_surface(surface, positions, normals, r[rows]) for r in data.residuals_um]
    near = np.isfinite(fields[0])[surface.faces].all(axis=1)
    traces = []
    last = len(data.models) - 1
    for pane, k in enumerate((0, last) if data.improved else (last,)):
        scene = {'scene': f'scene{pane + 1 if pane else ""}'}
        traces += [
            _mesh('far', ['residual'], color=SURFACE) | scene,
            _mesh('near', ['residual'], intensity=_f32(fields[k]), coloraxis='coloraxis') | scene,
            _mesh('all', ['film'], intensity=_f32(data.surfaces_um[index][k]),
                  coloraxis='coloraxis2') | scene,
            _readings(data, positions + LIFT_M * normals, rows, k) | scene,
        ]  # fmt: skip
        traces += [trace | scene for trace in _passes(experiment.path)]
    views = [
        _view('residual', 'Residual', RESIDUAL, [f'residual {when}' for when in _times(data)]),
        _view('film', 'Film', 'film [µm]', [f'film predicted {when}' for when in _times(data)]),
    ]
    if data.improved:
        views.append(
            _view('change', 'What was missing', 'residual, and change of the model [µm]',
                  ['residual before', 'what the model gained'])
        )  # fmt: skip
        gained = data.gained_um[index]
        traces[0]['views'].append('change')
        traces[1]['views'].append('change')
        traces[3]['views'].append('change')
        traces.append(
            _mesh('all', ['change'], intensity=_f32(gained), coloraxis='coloraxis')
            | {'scene': 'scene2'}
        )
    return {
        'name': experiment.name,
        'geometry': _geometry(surface, near),
        'data': traces,
        'layout': _layout(data, experiment),
        'views': views,
    }


def places_scene(data: ReportData, index: int) -> dict[str, Any] | None:
    """The part with what was measured and what to measure next; None where nothing is."""
    experiment = data.experiments[index]
    numbered = [(k + 1, p) for k, p in enumerate(data.places) if p.experiment == experiment.name]
    if not numbered:
        return None
    count = len(experiment)
    points = experiment.points
    measured = points.positions_m[:count] + LIFT_M * points.normals[:count]
    wanted = np.array([place.position_m for _, place in numbered])
    lifted = wanted + 2.0 * LIFT_M * experiment.surface.outward
    traces = [
        _mesh('all', ['places'], color=SURFACE),
        {'type': 'scatter3d', **_xyz(measured), 'mode': 'markers', 'name': 'measured',
         'marker': {'size': 3, 'color': MUTED}, 'hoverinfo': 'skip', 'views': ['places']},
        {'type': 'scatter3d', **_xyz(lifted), 'mode': 'markers+text', 'name': 'to measure',
         'text': [f'<b>{number}</b>' for number, _ in numbered],
         'textposition': 'top center', 'textfont': {'size': 14, 'color': ACCENT},
         'marker': {'size': 7, 'symbol': 'diamond', 'color': ACCENT,
                    'line': {'color': 'white', 'width': 1}},
         'customdata': np.round(wanted, 4),
         'hovertemplate': '%{customdata[0]:.3f}, %{customdata[1]:.3f}, %{customdata[2]:.3f} m'
                          '<extra>measure</extra>', 'views': ['places']},
    ]  # fmt: skip
    layout = base_layout(margin={'l': 0, 'r': 0, 't': 0, 'b': 0}, height=420, showlegend=False)
    return {
        'name': experiment.name,
        'data': traces,
        'layout': layout
        | {'scene': _scene(experiment, [0.0, 1.0], experiment.surface.vertices_m, PANE_ASPECT)},
        'views': [],
    }


def _times(data: ReportData) -> tuple[str, ...]:
    return ('before', 'after') if data.improved else ('',)


def _view(key: str, label: str, bar: str, titles: list[str]) -> dict[str, Any]:
    titles = [title.strip().capitalize() for title in titles]
    return {'key': key, 'label': label, 'bar': bar, 'titles': titles}


def _geometry(surface: Surface, near: np.ndarray) -> dict[str, Any]:
    kind = np.uint16 if len(surface.vertices_m) < 2**16 else np.int32
    faces = {'all': surface.faces, 'near': surface.faces[near], 'far': surface.faces[~near]}
    return {'vertices': _xyz(surface.vertices_m)} | {
        name: {axis: chosen[:, k].astype(kind) for k, axis in enumerate('ijk')}
        for name, chosen in faces.items()
    }


def _mesh(faces: str, views: list[str], **more: Any) -> dict[str, Any]:
    trace = {
        'type': 'mesh3d', 'geometry': faces, 'views': views, 'flatshading': False,
        'lighting': SHADED if 'color' in more else TRUE_COLOURS,
        'hoverinfo': 'skip',
    }  # fmt: skip
    if 'intensity' in more:
        trace |= {'hovertemplate': '%{intensity:.2f} µm<extra></extra>', 'hoverinfo': 'all'}
    return trace | more


def _readings(data: ReportData, lifted_m: np.ndarray, rows: slice, k: int) -> dict[str, Any]:
    residual = data.residuals_um[k][rows]
    measured = data.study.measured_um[rows]
    return {
        'type': 'scatter3d', **_xyz(lifted_m), 'mode': 'markers', 'views': ['residual'],
        'marker': {'size': 4.5, 'color': _f32(residual), 'coloraxis': 'coloraxis',
                   'line': {'color': INK, 'width': 1}},
        'customdata': np.round(np.column_stack([measured, measured - residual]), 2),
        'hovertemplate': 'measured %{customdata[0]:.2f} µm<br>predicted %{customdata[1]:.2f} µm'
                         '<br>residual %{marker.color:+.2f} µm<extra></extra>',
    }  # fmt: skip


def _passes(path: SprayPath) -> list[dict[str, Any]]:
    """Spraying passes as lines, numbered where they begin."""
    line: list[np.ndarray] = []
    starts, labels = [], []
    for number in np.unique(path.spray_pass[path.spray_pass >= 0]):
        rows = np.flatnonzero((path.spray_pass == number) & (path.flow > 0.0))
        if not len(rows):
            continue
        chosen = rows[np.linspace(0, len(rows) - 1, min(POINTS_A_PASS, len(rows))).astype(int)]
        line += [path.position_m[chosen], np.full((1, 3), np.nan)]
        starts.append(path.position_m[rows[0]])
        labels.append(str(number + 1))
    if not line:
        return []
    views = ['residual', 'film', 'change']
    return [
        {'type': 'scatter3d', **_xyz(np.concatenate(line)), 'mode': 'lines', 'passes': True,
         'line': {'color': MUTED, 'width': 2.5}, 'hoverinfo': 'skip', 'views': views},
        {'type': 'scatter3d', **_xyz(np.array(starts)), 'mode': 'markers+text', 'text': labels,
         'textposition': 'middle left', 'textfont': {'size': 12, 'color': INK}, 'passes': True,
         'marker': {'size': 3, 'color': INK}, 'views': views,
         'hovertemplate': 'pass %{text} begins<extra></extra>'},
    ]  # fmt: skip


def _layout(data: ReportData, experiment: Experiment) -> dict[str, Any]:
    absolute = np.abs(np.concatenate(data.residuals_um))
    reach = round_up(float(np.quantile(absolute, SHOWN_SHARE)))
    films = [film for part in data.surfaces_um for film in part]
    thickest = round_up(max(float(film.max()) for film in films))
    bar = {
        'orientation': 'h', 'thickness': 12, 'len': 0.5, 'x': 0.5, 'xanchor': 'center',
        'y': 0.0, 'yanchor': 'top', 'outlinewidth': 0, 'tickfont': {'size': 11, 'color': MUTED},
    }  # fmt: skip
    layout = base_layout(
        margin={'l': 0, 'r': 0, 't': 30, 'b': 70}, height=520, showlegend=False,
        coloraxis={'cmin': -reach, 'cmax': reach, 'colorscale': RESIDUAL_COLOURS,
                   'colorbar': bar | {'title': {'text': RESIDUAL, 'side': 'bottom'}}},
        coloraxis2={'cmin': 0, 'cmax': thickest, 'colorscale': FILM_COLOURS,
                    'colorbar': bar | {'title': {'text': 'film [µm]', 'side': 'bottom'}}},
    )  # fmt: skip
    domains = [[0.0, 0.497], [0.503, 1.0]] if data.improved else [[0.0, 1.0]]
    spraying = experiment.path.position_m[experiment.path.flow > 0.0]
    shown = np.concatenate([experiment.surface.vertices_m, spraying])
    for k, domain in enumerate(domains):
        aspect = PANE_ASPECT * (1.0 if data.improved else 2.0)
        layout[f'scene{k + 1 if k else ""}'] = _scene(experiment, domain, shown, aspect)
    return layout


def _scene(
    experiment: Experiment, domain: list[float], shown_m: np.ndarray, aspect: float
) -> dict[str, Any]:
    """Seen from the gun's side, a little from above and aside, filling its pane.

    Args:
        experiment: whose part is shown.
        domain: of the pane, from left to right.
        shown_m: (N, 3) everything that is to be in sight [m].
        aspect: width of the pane over its height.
    """
    surface = experiment.surface
    outward, down = surface.outward, surface.down
    upright = abs(outward @ down) < STANDING
    across = across_axis(outward, down)
    up = -down if upright else -downhill_axis(outward, down)
    gaze = outward + (0.16 * across + 0.10 * up if upright else -0.4 * up)
    gaze /= np.linalg.norm(gaze)
    low, high = shown_m.min(axis=0), shown_m.max(axis=0)
    extent = np.maximum(high - low, 1e-3)
    largest = extent.max()
    right = np.cross(up, gaze) / np.linalg.norm(np.cross(up, gaze))
    centred = (shown_m - 0.5 * (low + high)) / largest
    wide = np.abs(centred @ right).max() / aspect
    tall = np.abs(centred @ np.cross(gaze, right)).max()
    distance = ROOM_AROUND * max(wide, tall) / TAN_HALF_VIEW + np.abs(centred @ gaze).max()
    axes = {
        f'{name}axis': {'visible': False, 'range': [float(low[k]), float(low[k] + extent[k])]}
        for k, name in enumerate('xyz')
    }
    return axes | {
        'domain': {'x': domain, 'y': [0.0, 1.0]},
        'aspectmode': 'manual',
        'aspectratio': _named(extent / largest),
        'dragmode': 'turntable' if abs(up[2]) > 0.9 else 'orbit',
        'camera': {
            'eye': _named(distance * gaze),
            'up': _named(up),
            'center': {'x': 0, 'y': 0, 'z': 0},
            'projection': {'type': 'perspective'},
        },
    }  # fmt: skip


def _named(vector: np.ndarray) -> dict[str, float]:
    return dict(zip('xyz', np.round(vector, 4).tolist(), strict=True))


def _xyz(points: np.ndarray) -> dict[str, np.ndarray]:
    return {axis: points[:, k].astype(np.float32) for k, axis in enumerate('xyz')}


def _f32(values: np.ndarray) -> np.ndarray:
    return np.asarray(values, dtype=np.float32)
