"""Model files: the deposition model with its effects, as YAML that a person edits."""

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from io import StringIO
from pathlib import Path
from typing import Any

from pydantic import BaseModel, Field
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq

from paint_deposition.effects.base import Effect
from paint_deposition.effects.catalogue import EFFECTS, effect_class, learned_law
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.learned_laws import LearnedLaw
from paint_deposition.effects.library.occlusion import Occlusion
from paint_deposition.errors import ModelError, quoted
from paint_deposition.files.atomic import WORK, plain, read_yaml, write_text
from paint_deposition.files.effect_file import load_effect_file
from paint_deposition.inference.fitting.parameters import Posterior
from paint_deposition.model.eq1_pattern import MOST, Brush, BrushEntry, PlanarPattern
from paint_deposition.model.eq2_projection import Projection
from paint_deposition.request import validate

A_MAPPING = 'a mapping (key: value)'
COMMENT_COLUMN = 33
# What stands for all learned laws; the covariate says which.
LEARNED_ID = 'learned'
LoadEffect = Callable[[Path], type[Effect]]


class ProjectionSection(Projection):
    """Eq. (2) as a file gives it, with a key that stands for an effect."""

    occlusion: bool = Field(
        False, description='whether the effect occlusion is added, at full strength'
    )


class _Sections(BaseModel, extra='forbid'):
    """A model as it is written; a section may be empty."""

    name: str | None = Field(None, description='text')
    planar: dict[Any, Any] | None = Field(None, description=A_MAPPING)
    brushes: dict[Any, Any] | None = Field(None, description='a mapping of brushes by number')
    projection: dict[Any, Any] | None = Field(None, description=A_MAPPING)
    effects: list[dict[str, Any]] | None = Field(None, description='a list of mappings')
    uncertainty: dict[str, Any] | None = Field(None, description=A_MAPPING)
    posterior: dict[str, Any] | None = Field(None, description=A_MAPPING)
    history: list[dict[str, Any]] | None = Field(None, description='a list of mappings')


@dataclass(frozen=True)
class ModelFile:
    """A model and what is known about it.

    ``uncertainty`` are standard deviations in the sections of the model, ``history`` what was
    added and why, oldest first, ``posterior`` what the fit behind it knows of its parameters.
    ``path`` is that of its file, None for a model without.
    """

    model: DepositionModel
    name: str = ''
    uncertainty: Mapping[str, Any] = field(default_factory=dict)
    history: Sequence[Mapping[str, Any]] = ()
    posterior: Posterior | None = None
    path: Path | None = None


def read_model(path: str | Path, load_effect: LoadEffect = load_effect_file) -> DepositionModel:
    """The deposition model of a file, see ``read_model_file``."""
    return read_model_file(path, load_effect).model


def read_model_file(path: str | Path, load_effect: LoadEffect = load_effect_file) -> ModelFile:
    """The deposition model of a file with its name, uncertainty and history.

    What the file leaves out has its default. Effects given as ``file`` are looked for beside the
    model file, and ``load_effect`` runs their code: give ``load_unnamed_effect_file`` for a path
    that was found in other data. Raises ModelError naming the file, the key, its value and the
    remedy.
    """
    path = Path(path)
    content = read_yaml(path, 'model', ModelError)
    try:
        file = _model_file(content, lambda name: load_effect(path.parent / name))
        return replace(file, path=path)
    except ModelError as error:
        raise ModelError(f'{path}: {error}') from None


def model_source(path: Path) -> str:
    """The text of a model file, whose effect files are not run. Raises ModelError for another."""
    validate(_Sections, f'{path}: model', read_yaml(path, 'model', ModelError), ModelError)
    return path.read_text(encoding='utf-8')


def write_model(
    path: str | Path,
    model: DepositionModel,
    header_comment: str | None = None,
    history: Sequence[Mapping[str, Any]] | None = None,
    uncertainty: Mapping[str, Any] | None = None,
    name: str = '',
    posterior: Posterior | None = None,
) -> None:
    """Write a model with what each number means; an older file is replaced at once.

    Reading the file gives exactly this model. Files of users' own effects are named relative to
    it; ModelError names a class that has none. ``header_comment`` stands at the top, the rest is
    as in ``ModelFile``.
    """
    path = Path(path)
    extras = {
        'uncertainty': uncertainty or {},
        'posterior': posterior.model_dump(exclude_defaults=True) if posterior else {},
        'history': list(history or ()),
    }
    write_text(path, model_text(model, path.parent, header_comment or '', name, extras))


def _model_file(content: Any, load: Callable[[str], type[Effect]]) -> ModelFile:
    sections = validate(_Sections, 'model', content, ModelError)
    projection = validate(ProjectionSection, 'projection', sections.projection or {}, ModelError)
    effects: list[Effect] = []
    for number, entry in enumerate(sections.effects or (), start=1):
        effect = _effect(f'effects, entry {number}', entry, load)
        if effect.id in [other.id for other in effects]:
            raise ModelError(f'effects: {effect.id!r} is listed twice; keep one')
        effects.append(effect)
    if projection.occlusion:
        if any(effect.id == Occlusion.id for effect in effects):
            raise ModelError('occlusion is given in projection and in effects; keep the effect')
        effects.append(Occlusion(strength=1.0))
    if sections.brushes is None:
        planar = validate(PlanarPattern, 'planar', sections.planar or {}, ModelError)
        patterns = DepositionModel(planar=planar)
    elif sections.planar is not None:
        raise ModelError('planar and brushes are both given; keep one of them')
    else:
        patterns = DepositionModel(brushes=_brushes(sections.brushes))
    eq_2 = Projection(**projection.model_dump(exclude={'occlusion'}))
    model = patterns.model_copy(update={'projection': eq_2, 'effects': tuple(effects)})
    posterior = None
    if sections.posterior:
        posterior = validate(Posterior, 'posterior', sections.posterior, ModelError)
        posterior.check_suits(model)
    history = sections.history or []
    return ModelFile(model, sections.name or '', sections.uncertainty or {}, history, posterior)


def _brushes(section: Mapping[Any, Any]) -> list[Brush]:
    """The brushes of a section, each with its pattern."""
    if not section:
        raise ModelError('brushes is empty; give a brush by its number, or planar')
    brushes: list[Brush] = []
    for number, entry in section.items():
        if isinstance(number, bool) or not isinstance(number, int) or not 1 <= number <= MOST:
            raise ModelError(
                f'brushes: {quoted(number)} is not a brush number; give 1, 2 and so on'
            )
        given = validate(BrushEntry, f'brushes, {number}', entry, ModelError)
        if given.planar is None:
            raise ModelError(
                f'brushes, {number}: planar is missing; calibrate the brush, or take it out'
            )
        planar = validate(PlanarPattern, f'brushes, {number}: planar', given.planar, ModelError)
        set_points = given.model_dump(exclude={'planar'})
        brushes.append(Brush(number=number, planar=planar, **set_points))
    return brushes


def _effect(where: str, entry: dict[str, Any], load: Callable[[str], type[Effect]]) -> Effect:
    """The effect of an entry: by its id, a user's file, or the covariate of a learned law."""
    chosen = [key for key in ('id', 'file') if key in entry]
    if len(chosen) != 1:
        raise ModelError(f'{where}: has {" and ".join(chosen) or "no id"}; give one of id, file')
    values = dict(entry)
    source = values.pop(chosen[0])
    if not isinstance(source, str):
        raise ModelError(f'{where}: {chosen[0]} is {quoted(source)}; expected text')
    if chosen == ['file']:
        cls = load(source)
    elif source == LEARNED_ID:
        covariate = values.pop('covariate', None)
        if not isinstance(covariate, str):
            raise ModelError(
                f'{where}: covariate is {quoted(covariate)}; give that of the learned law, as '
                'time_s'
            )
        cls = learned_law(covariate)
        source = cls.id
    else:
        cls = effect_class(source)
    return validate(cls, source, values, ModelError)


def model_text(
    model: DepositionModel, folder: Path, header_comment: str, name: str, extras: Mapping[str, Any]
) -> str:
    """YAML of a model for a file in ``folder``, to which users' own effects are named relative.

    ``extras`` are plain values by top-level key, left out where empty.
    """
    text = CommentedMap({'name': name} if name else {})
    if header_comment:
        # Names may hold what ends a line for YAML, and what it does not take.
        lines = (''.join(filter(str.isprintable, line)) for line in header_comment.splitlines())
        text.yaml_set_start_comment('\n'.join(lines))
    if model.brushes:
        text['brushes'] = CommentedMap()
        for brush in model.brushes:
            entry = CommentedMap({'planar': _fields(brush.planar)})
            entry |= plain(brush.model_dump(exclude={'number', 'planar'}, exclude_none=True))
            for key in [*entry][1:]:
                description = BrushEntry.model_fields[key].description
                entry.yaml_add_eol_comment(description, key, COMMENT_COLUMN)
            text['brushes'][brush.number] = entry
    else:
        text['planar'] = _fields(model.planar)
    text['projection'] = _fields(model.projection)
    text['effects'] = [_effect_text(effect, folder) for effect in model.effects]
    text |= {key: _with_rows(plain(value)) for key, value in extras.items() if value}
    comments = {
        'planar': 'eq. (1): flux on the model plane',
        'brushes': 'eq. (1) and set-points by number',
        'projection': 'eq. (2): from the model plane to the surface',
        'uncertainty': 'standard deviations',
        'posterior': 'posterior of the fit: the prior of the next job',
        'history': 'what was added, oldest first',
    }
    for key, comment in comments.items():
        if key in text:
            text.yaml_add_eol_comment(comment, key, COMMENT_COLUMN)
    stream = StringIO()
    writer = YAML()
    writer.width = 10_000
    writer.indent(sequence=4, offset=2)
    writer.dump(text, stream)
    return stream.getvalue()


def _with_rows(value: Any) -> Any:
    """The same with lists of plain values on one line each."""
    if isinstance(value, dict):
        return {key: _with_rows(inner) for key, inner in value.items()}
    if isinstance(value, list) and not any(isinstance(inner, dict) for inner in value):
        row = CommentedSeq(value)
        row.fa.set_flow_style()
        return row
    return value


def _effect_text(effect: Effect, folder: Path) -> CommentedMap:
    if isinstance(effect, LearnedLaw):
        text = _fields(effect, id=LEARNED_ID, covariate=effect.covariate)
        for name in ('sd', 'acts_with'):
            if not text.get(name):
                text.pop(name, None)
        for name in {'learned', 'sd'} & text.keys():
            text[name] = _with_rows(text[name])
        about = f'{effect.over} [{effect.unit}]'
        text.yaml_add_eol_comment(about, 'covariate', COMMENT_COLUMN)
        return text
    require_file(type(effect))
    source, name = 'id', effect.id
    if effect.file:
        source, name = 'file', effect.file.as_posix()
        parts = folder.resolve().parts
        if WORK in parts:  # results that are being written, and will be two levels above
            at = parts.index(WORK)
            parts = (*parts[:at], *parts[at + 2 :])
        with suppress(ValueError):  # on another drive
            name = Path(os.path.relpath(effect.file, Path(*parts))).as_posix()
    text = _fields(effect, **{source: name})
    text.yaml_add_eol_comment(effect.family, source, COMMENT_COLUMN)
    return text


def _fields(values: BaseModel, **before: str) -> CommentedMap:
    text = CommentedMap({**before, **plain(values.model_dump())})
    for name, info in type(values).model_fields.items():
        if info.description and name in text:
            text.yaml_add_eol_comment(info.description, name, COMMENT_COLUMN)
    return text


def require_file(effect: type[Effect]) -> None:
    """Refuse a user's own class of a script or a notebook: a model names the file of it."""
    known = issubclass(effect, LearnedLaw) or effect.file is not None or effect.id in EFFECTS
    if not known:
        raise ModelError(
            f'effect {effect.id!r} has no file; put {effect.__name__} in a file of its own and '
            'load that with load_effect_file'
        )
