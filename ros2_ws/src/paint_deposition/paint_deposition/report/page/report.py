"""The report: one HTML file that needs no network, for the browser and for paper."""

import json
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from paint_deposition import __version__
from paint_deposition.comparison.comparison import Comparison
from paint_deposition.diagnosis.next_experiment import Place, Spray
from paint_deposition.diagnosis.verdict import Diagnosis
from paint_deposition.effects.base import Effect
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.files.atomic import write_text
from paint_deposition.files.provenance import git_version
from paint_deposition.fitting.study import Study
from paint_deposition.report import words
from paint_deposition.report.data import ReportData
from paint_deposition.report.page import figures as charts
from paint_deposition.report.page import tables
from paint_deposition.report.page.headline import headline, key_figures
from paint_deposition.report.page.profiles import profile_figure
from paint_deposition.report.page.scene import places_scene, scene_data

TEMPLATES = Path(__file__).parent / 'templates'
SPRAYS_SHOWN = 5


def write_report(
    path: str | Path,
    study: Study,
    models: Sequence[tuple[DepositionModel, Comparison]],
    diagnosis: Diagnosis | None = None,
    places: Sequence[Place] = (),
    sprays: Sequence[Spray] = (),
    older: Sequence[Mapping[str, Any]] = (),
    library: Mapping[str, type[Effect]] = EFFECTS,
) -> None:
    """Write the report as one HTML file, whole or not at all.

    Args:
        path: where to.
        study: the readings.
        models: with their comparisons, base first, best last; one where nothing was added.
        diagnosis: None after a comparison alone.
        places, sprays: what to measure and spray next.
        older: history of the model that a diagnosis started from, as in its file.
        library: the effects that were looked for, by id, users' own among them.
    """
    data = ReportData.of(study, models, diagnosis, places, sprays, older, library)
    write_text(path, report_html(data))


def report_html(data: ReportData) -> str:
    """The page as text."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from plotly.offline import get_plotlyjs

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    filters: dict[str, Callable[..., str]] = {
        'um': lambda value: words.minus(f'{value:.2f}'),
        'signed': lambda value: words.micrometres(value, signed=True).removesuffix(' µm'),
        'whole': lambda value: words.minus(f'{value:.0f}'),
        'p': words.p_words,
        'in_print': words.in_print,
        'effect': words.effect_name,
    }
    environment.filters.update(filters)
    scenes = [scene_data(data, k) for k in range(len(data.experiments))]
    figures = _figures(data)
    return environment.get_template('report.html.j2').render(
        data=data,
        headline=headline(data),
        key_figures=key_figures(data),
        counts=words.count_words(data.study),
        classes=tables.class_rows(data),
        effects=tables.effect_rows(data),
        pattern=tables.pattern_rows(data),
        blind=tables.blind_rows(data),
        history=tables.history_rows(data),
        misfits=tables.misfit_rows(data),
        sprays=data.sprays[:SPRAYS_SHOWN],
        provenance=_provenance(),
        lined=all(len(p.line_m) for p in data.profiles),
        figures=[f['name'] for f in figures],
        content=_as_json(
            {
                'scenes': scenes,
                'first': _most_telling(data),
                'places': _places(data),
                'figures': figures,
            }
        ),
        style=(TEMPLATES / 'report.css').read_text(encoding='utf-8'),
        script=(TEMPLATES / 'report.js').read_text(encoding='utf-8'),
        plotly=get_plotlyjs(),
    )


def _figures(data: ReportData) -> list[dict[str, Any]]:
    found = [
        *(profile_figure(data, k) for k in range(len(data.experiments))),
        charts.parity_figure(data),
        charts.covariate_figure(data),
        charts.history_figure(data),
        charts.unknown_figure(data),
    ]
    return [f for f in found if f is not None]


def _places(data: ReportData) -> list[dict[str, Any] | None]:
    return [places_scene(data, k) for k in range(len(data.experiments))]


def _most_telling(data: ReportData) -> int:
    """The experiment on which the model gained most, or is furthest off: it is shown first."""
    squares = data.residuals_um[0] ** 2
    if data.improved:
        squares = squares - data.residuals_um[-1] ** 2
    rows = [data.rows_of(k) for k in range(len(data.experiments))]
    return int(np.argmax([np.sum(squares[here]) for here in rows]))


def _provenance() -> list[tuple[str, str]]:
    git = git_version()
    return [
        ('Made', datetime.now().astimezone().strftime('%Y-%m-%d %H:%M %Z')),
        ('paint_deposition', f'{__version__} ({git})' if git else __version__),
    ]


def _as_json(content: Any) -> str:
    """JSON that may stand inside a script element; arrays as plotly's typed arrays."""
    text = json.dumps(content, default=_encoded, separators=(',', ':'), allow_nan=False)
    return text.replace('<', '\\u003c')


def _encoded(value: Any) -> Any:
    if isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind in 'fiu':
        return _typed_array(value)
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f'{type(value).__name__} cannot be written into the report')


def _typed_array(values: np.ndarray) -> dict[str, str]:
    from base64 import b64encode

    if values.dtype == np.float64:
        values = values.astype(np.float32)
    if values.dtype == np.int64:
        values = values.astype(np.int32)
    kind = f'{values.dtype.kind}{values.dtype.itemsize}'
    little = values.astype(values.dtype.newbyteorder('<'))
    return {'dtype': kind, 'bdata': b64encode(little.tobytes()).decode('ascii')}
