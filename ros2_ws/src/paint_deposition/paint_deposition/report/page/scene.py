"""The part in 3D: film, residual before and after, spray passes, points to measure.

The mesh is kept once; traces name the geometry that the page's script hands to them.
"""

from typing import Any

import numpy as np

from paint_deposition.film.colour_scales import round_up
from paint_deposition.inference.comparison.profiles import Profile
from paint_deposition.inference.comparison.residual_field import spread_over_surface
from paint_deposition.inference.readings.campaign import Experiment
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.axes import across_axis, downhill_axis
from paint_deposition.part.surface import Surface
from paint_deposition.report.data import ReportData
from paint_deposition.report.page.layout import FILM_COLOURS, RESIDUAL_COLOURS, axis, base_layout
from paint_deposition.report.pictures.view import View
from paint_deposition.report.style import INK, MUTED

SURFACE = '#c3c9cf'
# Few readings beyond the end of the colours do not take the contrast from all others.
SHOWN_SHARE = 0.98
POINTS_A_PASS = 60
WAY_POINTS = 400
RESIDUAL, FILM = 'measured minus predicted [µm]', 'film [µm]'
# Marks float this far above the surface, so that it does not swallow half of them [m].
LIFT_M = 0.008
# Bare surface shows its relief; film and residual have the colours of their scale.
SHADED = {'ambient': 0.9, 'diffuse': 0.35, 'specular': 0.0, 'roughness': 1.0, 'fresnel': 0.0}
TRUE_COLOURS = SHADED | {'ambient': 1.0, 'diffuse': 0.2}
# Plotly's camera sees 45 deg from bottom to top.
TAN_HALF_VIEW, ROOM_AROUND = float(np.tan(np.pi / 8.0)), 1.06
PANE_ASPECT = 1.2
# A part whose outward side leans less toward the vertical than this is looked at upright.
STANDING = 0.98


def scene_data(data: ReportData, index: int) -> dict[str, Any]:
    """Geometry, traces and views of one experiment.

    Each trace has ``views``, those in which it is shown, and ``geometry``, the faces it has.
    """
    experiment, rows = data.experiments[index], data.rows_of(index)
    surface, painted = experiment.surface, data.painted[index]
    positions, normals = _places_of(experiment)
    fields = [spread_over_surface(surface, positions, normals, r[rows]) for r in data.residuals_um]
    near = np.isfinite(fields[0])[surface.faces].all(axis=1)
    traces = []
    for k in range(len(data.models)):
        # What the model gained is set beside the residual before.
        views = ['residual', 'change'] if data.improved and k == 0 else ['residual']
        panes = [
            _mesh('far', views, color=SURFACE),
            _mesh('near', views, intensity=fields[k], coloraxis='coloraxis'),
            _mesh('all', ['film'], intensity=painted[k].film_um, coloraxis='coloraxis2'),
            _readings(data, positions + LIFT_M * normals, rows, k) | {'views': views},
            *_passes(experiment.path),
        ]
        if data.improved and k:
            gained = painted[k].gauge_um - painted[0].gauge_um
            panes.append(_mesh('all', ['change'], intensity=gained, coloraxis='coloraxis'))
        traces.append(panes)
    times: tuple[str, ...] = (' before', ' after') if data.improved else ('',)
    if data.names:
        times = tuple(f': {name}' for name in data.names)
    views_shown = [
        ('residual', 'Residual', RESIDUAL, [f'Residual{when}' for when in times]),
        ('film', 'Film', FILM, [f'Film predicted{when}' for when in times]),
        ('change', 'What was missing', 'residual, and change of the model [µm]',
         ['Residual before', 'What the model gained']),
    ]  # fmt: skip
    return {
        'name': experiment.name,
        'geometry': _geometry(surface, near),
        'panes': traces,
        'lines': data.lines,
        'films': [f'{name.replace(" ", "_")}_um' for name in data.model_names],
        'plane': _plane(surface),
        'readings': {
            **_xyz(positions),
            'measured': data.study.measured_um[rows],
            'lines': [
                {'label': p.label, **_line_of(data, p, index)}
                for p in data.profiles
                if p.experiment == experiment.name and len(p.rows) > 1
            ],
        },
        'way': _way(experiment.path),
        'reach_m': data.model.projection.model_plane_m - data.model.projection.emission_offset_m,
        'layout': _layout(data, experiment),
        'views': [
            dict(zip(('key', 'label', 'bar', 'titles'), view, strict=True))
            for view in views_shown[: 3 if data.improved else 2]
        ],
    }


def _plane(surface: Surface) -> dict[str, Any]:
    """Axes of the part as the gun sees it, in which the page lays its sections."""
    view = View.of_front(surface.outward, surface.down)
    return {
        'right': view.right, 'up': view.up, 'toward': surface.outward,
        'centre': surface.centre_m, 'labels': view.labels,
    }  # fmt: skip


def section_layout() -> dict[str, Any]:
    """Of the film along a line over the part; the page's script fills it."""
    return base_layout(
        height=260, xaxis=axis('along the line, from the centre [mm]', nticks=9),
        yaxis=axis(FILM, rangemode='tozero'),
    )  # fmt: skip


def _line_of(data: ReportData, profile: Profile, index: int) -> dict[str, float]:
    """The straight line through a column or row: its angle [deg] and its offset [m]."""
    plane = _plane(data.experiments[index].surface)
    off = data.study.campaign.positions_m[profile.rows] - plane['centre']
    flat = np.column_stack([off @ plane['right'], off @ plane['up']])
    along = np.linalg.svd(flat - flat.mean(axis=0))[2][0]
    angle = np.degrees(np.arctan2(along[1], along[0])) % 180.0
    across = np.array([-np.sin(np.radians(angle)), np.cos(np.radians(angle))])
    return {'angle': round(float(angle), 1), 'offset': float(flat.mean(axis=0) @ across)}


def _way(path: SprayPath) -> dict[str, Any]:
    """The motion in few samples: time, TCP, axis of the bell, pass, speed, gun on or off."""
    chosen = np.unique(np.linspace(0, len(path) - 1, min(WAY_POINTS, len(path))).astype(int))
    bell = path.rotation[chosen][:, :, 2]
    return {
        'time_s': (path.stamp_ns[chosen] - path.stamp_ns[0]) * 1e-9,
        **_xyz(path.position_m[chosen]),
        **{f'a{name}': values for name, values in _xyz(bell).items()},
        'pass': path.spray_pass[chosen] + 1,
        'speed': path.speed_m_per_s[chosen],
        'on': (path.flow[chosen] > 0.0).astype(int),
    }


def places_scene(data: ReportData, index: int) -> dict[str, Any] | None:
    """The part with its present film, what was measured and what to measure next.

    None where nothing is to be measured.
    """
    experiment, (places, _) = data.experiments[index], data.proposals
    numbered = [(k, p) for k, p in enumerate(places, start=1) if p.experiment == experiment.name]
    if not numbered:
        return None
    positions, normals = _places_of(experiment)
    film_um = data.painted[index][-1].film_um
    wanted = np.array([place.position_m for _, place in numbered])
    traces = [
        _mesh('all', [], intensity=film_um, coloraxis='coloraxis'),
        _marks(positions + LIFT_M * normals, name='measured', hoverinfo='skip',
               marker={'size': 3, 'color': INK}),
        _marks(wanted + 2.0 * LIFT_M * experiment.surface.outward, mode='markers+text',
               name='to measure', text=[f'<b>{number}</b>' for number, _ in numbered],
               textposition='top center', textfont={'size': 14, 'color': MUTED},
               marker={'size': 7, 'symbol': 'diamond', 'color': 'white',
                       'line': {'color': INK, 'width': 2}},
               customdata=np.round(wanted, 4),
               hovertemplate='%{customdata[0]:.3f}, %{customdata[1]:.3f}, %{customdata[2]:.3f} m'
                             '<extra>measure</extra>'),
    ]  # fmt: skip
    scene = _scene(experiment, experiment.surface.vertices_m)
    colours = _colours(FILM, FILM_COLOURS, 0.0, round_up(float(film_um.max())))
    return {'data': traces, 'layout': _scene_layout(370, scene=scene, coloraxis=colours)}


def _places_of(experiment: Experiment) -> tuple[np.ndarray, np.ndarray]:
    """(P, 3) positions of the readings' points [m] and (P, 3) normals there."""
    points, count = experiment.points, len(experiment)
    return points.positions_m[:count], points.normals[:count]


def _geometry(surface: Surface, near: np.ndarray) -> dict[str, Any]:
    faces = {'all': surface.faces, 'near': surface.faces[near], 'far': surface.faces[~near]}
    return {'vertices': _xyz(surface.vertices_m)} | {
        name: dict(zip('ijk', chosen.T, strict=True)) for name, chosen in faces.items()
    }


def _mesh(faces: str, views: list[str], **look: Any) -> dict[str, Any]:
    """Faces of the part in one colour, or coloured by the intensity at their vertices."""
    if 'intensity' in look:
        hover = {'lighting': TRUE_COLOURS, 'hovertemplate': '%{intensity:.2f} µm<extra></extra>'}
    else:
        # 'skip' would take clicks away, too.
        hover = {'lighting': SHADED, 'hoverinfo': 'none'}
    return {'type': 'mesh3d', 'geometry': faces, 'views': views} | hover | look


def _marks(points_m: np.ndarray, **look: Any) -> dict[str, Any]:
    return {'type': 'scatter3d', 'mode': 'markers', **_xyz(points_m), **look}


def _readings(data: ReportData, lifted_m: np.ndarray, rows: slice, k: int) -> dict[str, Any]:
    residual = data.residuals_um[k][rows]
    measured = data.study.measured_um[rows]
    return _marks(
        lifted_m,
        marker={'size': 4.5, 'color': residual, 'coloraxis': 'coloraxis',
                'line': {'color': INK, 'width': 1}},
        customdata=np.round(np.column_stack([measured, measured - residual]), 2),
        hovertemplate='measured %{customdata[0]:.2f} µm<br>predicted %{customdata[1]:.2f} µm'
                      '<br>residual %{marker.color:+.2f} µm<extra></extra>',
    )  # fmt: skip


def _passes(path: SprayPath) -> list[dict[str, Any]]:
    """Spraying passes as lines, numbered where they begin."""
    spraying = path.select(path.flow > 0.0)
    line: list[np.ndarray] = []
    starts: dict[str, np.ndarray] = {}
    for number in np.unique(spraying.spray_pass[spraying.spray_pass >= 0]):
        way_m = spraying.position_m[spraying.spray_pass == number]
        chosen = np.linspace(0, len(way_m) - 1, min(POINTS_A_PASS, len(way_m))).astype(int)
        line += [way_m[chosen], np.full((1, 3), np.nan)]
        starts[str(number + 1)] = way_m[0]
    if not line:
        return []
    shown = {'passes': True, 'views': ['residual', 'film', 'change']}
    return [
        _marks(np.concatenate(line), mode='lines', line={'color': MUTED, 'width': 2.5},
               hoverinfo='skip', **shown),
        _marks(np.array(list(starts.values())), mode='markers+text', text=list(starts),
               textposition='middle left', textfont={'size': 12, 'color': MUTED},
               marker={'size': 3, 'color': INK},
               hovertemplate='pass %{text} begins<extra></extra>', **shown),
    ]  # fmt: skip


def _layout(data: ReportData, experiment: Experiment) -> dict[str, Any]:
    absolute = np.abs(np.concatenate(data.residuals_um))
    reach = round_up(float(np.quantile(absolute, SHOWN_SHARE)))
    films = [painted.film_um for part in data.painted for painted in part]
    thickest = round_up(max(float(film.max()) for film in films))
    spraying = experiment.path.position_m[experiment.path.flow > 0.0]
    shown = np.concatenate([experiment.surface.vertices_m, spraying])
    return _scene_layout(
        370,
        scene=_scene(experiment, shown),
        coloraxis=_colours(RESIDUAL, RESIDUAL_COLOURS, -reach, reach),
        coloraxis2=_colours(FILM, FILM_COLOURS, 0.0, thickest),
    )


def _scene_layout(height: int, **more: Any) -> dict[str, Any]:
    return base_layout(margin={'l': 0, 'r': 0, 't': 0, 'b': 64}, height=height, **more)


def _colours(title: str, scale: list[list[Any]], low: float, high: float) -> dict[str, Any]:
    bar = {
        'orientation': 'h', 'thickness': 12, 'len': 0.8, 'x': 0.5, 'xanchor': 'center',
        'y': 0.0, 'yanchor': 'top', 'outlinewidth': 0, 'tickfont': {'size': 11, 'color': MUTED},
        'title': {'text': title, 'side': 'bottom'},
    }  # fmt: skip
    return {'cmin': low, 'cmax': high, 'colorscale': scale, 'colorbar': bar}


def _scene(experiment: Experiment, shown_m: np.ndarray) -> dict[str, Any]:
    """Seen from the gun's side, a little from above and aside, filling its pane.

    Args:
        experiment: whose part is shown.
        shown_m: (N, 3) everything that is to be in sight [m].
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
    wide = np.abs(centred @ right).max() / PANE_ASPECT
    tall = np.abs(centred @ np.cross(gaze, right)).max()
    distance = ROOM_AROUND * max(wide, tall) / TAN_HALF_VIEW + np.abs(centred @ gaze).max()
    axes = {
        f'{name}axis': {'visible': False, 'range': [float(low[k]), float(low[k] + extent[k])]}
        for k, name in enumerate('xyz')
    }
    return axes | {
        'aspectratio': _named(extent / largest),
        'dragmode': 'turntable' if abs(up[2]) > 0.9 else 'orbit',
        'camera': {'eye': _named(distance * gaze), 'up': _named(up)},
    }


def _named(vector: np.ndarray) -> dict[str, float]:
    return dict(zip('xyz', np.round(vector, 4).tolist(), strict=True))


def _xyz(points: np.ndarray) -> dict[str, np.ndarray]:
    return dict(zip('xyz', points.T, strict=True))
