"""Model files: the deposition model with its effects, as YAML that a person edits."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import Field

from paint_deposition.effects.base import Effect
from paint_deposition.effects.catalogue import effect_class
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.library.occlusion import Occlusion
from paint_deposition.effects.user_effects import load_effect_file
from paint_deposition.errors import ModelError, did_you_mean
from paint_deposition.files.atomic import write_text
from paint_deposition.files.model_text import LEARNED_ID, model_text
from paint_deposition.files.refusals import Made, checked
from paint_deposition.files.strict_yaml import read_yaml
from paint_deposition.inference.posterior import Posterior
from paint_deposition.model.brush import MOST, Brush, BrushLaw, SetPoints
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.model.eq2_projection import Projection

WORDS: dict[type, str] = {dict: 'a mapping (key: value)', list: 'a list', str: 'text'}
KEYS = (
    'name', 'planar', 'brushes', 'projection', 'effects', 'uncertainty', 'posterior', 'history',
)  # fmt: skip

BRUSH_KEYS = ('planar', *SetPoints.model_fields)

LoadEffect = Callable[[Path], type[Effect]]


class ProjectionSection(Projection):
    """Eq. (2) as a file gives it, with a key that stands for an effect."""

    occlusion: bool = Field(
        False, description='whether the effect occlusion is added, at full strength'
    )


@dataclass(frozen=True)
class ModelFile:
    """A model and what is known about it.

    Attributes:
        model: the deposition model.
        name: what the user calls it, '' for nothing.
        uncertainty: standard deviations of parameters, in the sections of the model.
        history: what was added to it and why, oldest first.
        posterior: what the fit behind it knows of its parameters, or None.
    """

    model: DepositionModel
    name: str = ''
    uncertainty: Mapping[str, Any] = field(default_factory=dict)
    history: Sequence[Mapping[str, Any]] = ()
    posterior: Posterior | None = None


def read_model(path: str | Path, load_effect: LoadEffect = load_effect_file) -> DepositionModel:
    """The deposition model of a file; ``load_effect`` reads the effect files that it names.

    Raises:
        ModelError: naming the file, the key, its value and the remedy.
    """
    return read_model_file(path, load_effect).model


def read_model_file(path: str | Path, load_effect: LoadEffect = load_effect_file) -> ModelFile:
    """The deposition model of a file with its name, uncertainty and history.

    What the file leaves out has its default. Effects given as ``file`` are looked for beside the
    model file, and their code is run.

    Raises:
        ModelError: naming the file, the key, its value and the remedy.
    """
    path = Path(path)
    content = read_yaml(path, 'model', ModelError)
    if not isinstance(content, dict):
        raise ModelError(f'{path}: holds no model; expected the keys planar and projection')
    try:
        return _model_file(content, lambda name: load_effect(path.parent / name))
    except ModelError as error:
        raise ModelError(f'{path}: {error}') from None


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

    Args:
        path: YAML; files of users' own effects are named relative to it.
        model: reading the file gives exactly this model.
        header_comment: lines to put at the top.
        history, uncertainty, name, posterior: as in ``ModelFile``.
    """
    path = Path(path)
    extras = {
        'uncertainty': uncertainty or {},
        'posterior': posterior.model_dump(exclude_defaults=True) if posterior else {},
        'history': list(history or ()),
    }
    write_text(path, model_text(model, path.parent, header_comment or '', name, extras))


def _model_file(content: dict[str, Any], load: Callable[[str], type[Effect]]) -> ModelFile:
    for key in content:
        if key not in KEYS:
            raise ModelError(f'unknown key {key!r}; {did_you_mean(key, KEYS)}')
    patterns = _patterns(content)
    projection = _section(ProjectionSection, 'projection', content)
    effects: list[Effect] = []
    for where, entry in _mappings('effects', content).items():
        effect = _effect(where, entry, load)
        if effect.id in [other.id for other in effects]:
            raise ModelError(f'effects: {effect.id!r} is there twice; keep one')
        effects.append(effect)
    if projection.occlusion:
        if any(effect.id == Occlusion.id for effect in effects):
            raise ModelError('occlusion is given in projection and in effects; keep the effect')
        effects.append(Occlusion(strength=1.0))
    eq_2 = Projection(**projection.model_dump(exclude={'occlusion'}))
    model = patterns.model_copy(update={'projection': eq_2, 'effects': tuple(effects)})
    model.effects_by_pattern()  # refuses what effects cannot follow
    return ModelFile(
        model,
        _given(str, 'name', content),
        _given(dict, 'uncertainty', content),
        list(_mappings('history', content).values()),
        _posterior(content, model),
    )


def _posterior(content: dict[str, Any], model: DepositionModel) -> Posterior | None:
    if not _given(dict, 'posterior', content):
        return None
    posterior = _section(Posterior, 'posterior', content)
    posterior.check_suits(model)
    return posterior


def _patterns(content: dict[str, Any]) -> DepositionModel:
    """A model with the pattern of the file, or with its brushes."""
    if content.get('brushes') is None:
        return DepositionModel(planar=_section(PlanarPattern, 'planar', content))
    if content.get('planar') is not None:
        raise ModelError('planar and brushes are both given; keep one of them')
    brushes = _brushes(_given(dict, 'brushes', content))
    return DepositionModel.of_brushes(brushes)


def _brushes(section: Mapping[Any, Any]) -> list[Brush]:
    """The brushes of a section; those without a pattern are interpolated between the others."""
    if not section:
        raise ModelError('brushes is empty; give a brush by its number, or planar')
    for number in section:
        if isinstance(number, bool) or not isinstance(number, int) or not 1 <= number <= MOST:
            raise ModelError(f'brushes: {number!r} is no number of a brush; give 1, 2 and so on')
    read = {number: _entry(number, entry) for number, entry in section.items()}
    calibrated = [_brush(n, planar, at) for n, (planar, at) in read.items() if planar]
    law = BrushLaw(tuple(calibrated))
    between = [
        _brush(n, law.pattern(f'brushes, {n}', at), at, interpolated=True)
        for n, (planar, at) in read.items()
        if planar is None
    ]
    return [*calibrated, *between]


def _brush(number: int, planar: PlanarPattern, at: SetPoints, interpolated: bool = False) -> Brush:
    return Brush(number=number, planar=planar, interpolated=interpolated, **at.model_dump())


def _entry(number: int, entry: Any) -> tuple[PlanarPattern | None, SetPoints]:
    """Pattern, None where it is to be interpolated, and set-points of an entry."""
    where = f'brushes, {number}'
    if not isinstance(entry, dict):
        raise ModelError(f'{where} is {entry!r}; expected a mapping (key: value)')
    for key in entry:
        if key not in BRUSH_KEYS:
            raise ModelError(f'{where}: unknown key {key!r}; {did_you_mean(key, BRUSH_KEYS)}')
    settings = {key: value for key, value in entry.items() if key != 'planar'}
    set_points = checked(SetPoints, where, settings, ModelError)
    if 'planar' not in entry:
        return None, set_points
    if not isinstance(entry['planar'], dict):
        raise ModelError(f'{where}: planar is {entry["planar"]!r}; expected a mapping')
    return checked(PlanarPattern, f'{where}: planar', entry['planar'], ModelError), set_points


def _section(cls: type[Made], key: str, content: dict[str, Any]) -> Made:
    return checked(cls, key, _given(dict, key, content), ModelError)


def _effect(where: str, entry: dict[str, Any], load: Callable[[str], type[Effect]]) -> Effect:
    chosen = [key for key in ('id', 'file') if key in entry]
    if len(chosen) != 1:
        raise ModelError(f'{where}: has {" and ".join(chosen) or "no id"}; give one of id, file')
    source = entry[chosen[0]]
    if not isinstance(source, str):
        raise ModelError(f'{where}: {chosen[0]} is {source!r}; expected text')
    if entry.get('id') == LEARNED_ID:
        return _learned(where, entry)
    cls = effect_class(source) if chosen == ['id'] else load(source)
    values = {key: entry[key] for key in entry if key not in chosen}
    return checked(cls, source, values, ModelError)


def _learned(where: str, entry: dict[str, Any]) -> Effect:
    """A learned law: its covariate says which."""
    covariate = _given(str, f'{where}: covariate', {f'{where}: covariate': entry.get('covariate')})
    if not covariate:
        raise ModelError(
            f'{where}: has no covariate; give that of the learned law, such as time_s'
        )
    # Loaded by those only whose models have learned.
    from paint_deposition.effects.catalogue import learned_law

    cls = learned_law(covariate)
    values = {key: entry[key] for key in entry if key not in ('id', 'covariate')}
    return checked(cls, cls.id, values, ModelError)


def _mappings(key: str, content: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """The entries of a list, by the words for where they stand."""
    entries = enumerate(_given(list, key, content), start=1)
    places = {f'{key}, entry {number}': entry for number, entry in entries}
    return {where: _given(dict, where, places) for where in places}


def _given(kind: type, key: str, content: dict[str, Any]) -> Any:
    """The value of a key, empty where the file says nothing."""
    value = content.get(key)
    if value is None:
        return kind()
    if not isinstance(value, kind):
        raise ModelError(f'{key} is {value!r}; expected {WORDS[kind]}')
    return value
