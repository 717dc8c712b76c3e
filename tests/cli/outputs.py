"""What scripts rely on in the JSON of commands: keys that stay and the types of their values.

More may be added. Lengths are in m, times in s, angles in rad unless the name says otherwise,
films in um; null is a number that is not known.
"""

# The types are made by functions, which mypy cannot follow.
# mypy: ignore-errors

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, create_model

Number = float | None
Pair = Annotated[list[Number], Field(min_length=2, max_length=2)]
Words = list[str]


class Figures(BaseModel):
    """Base of all: numbers are numbers, and keys that are not named here are let through."""

    model_config = ConfigDict(strict=True, extra='allow')


def figures(numbers: str = '', /, base: type[BaseModel] = Figures, **fields: Any) -> Any:
    """A JSON object with these numbers, which may be null, and fields of other types."""
    kinds = dict.fromkeys(numbers.split(), Number) | fields
    required = {name: (kind, ...) for name, kind in kinds.items()}
    return create_model('Figures', __base__=base, **required)


Sha256 = Annotated[str, Field(pattern='^[0-9a-f]{64}$')]
Model = figures(projection=dict, effects=list[figures(id=str)], sha256=Sha256)
Provenance = figures(
    package_version=str, git_version=str, campaign=str, models=dict[str, Model],
    files=list[figures(what=str, file=str, sha256=Sha256)],
)  # fmt: skip
# Every JSON.
ANY = figures(provenance=Provenance)

Film = figures(
    'mean_um std_dev_um min_um max_um coverage within_target cpk painted_volume_cm3 '
    'capture_fraction emitted_volume_cm3 target_um'
)
Region = figures('mean_residual_um', description=str, experiment=str, readings=int)
Interval = figures('value low high')
BeforeAfter = figures('before after')
Diagnosis = figures(
    'p_value', ANY, reason=str, accepted=Words, unknown=dict | None, not_testable=Words,
    verdict=Literal['none_missing', 'effect_missing', 'undecided', 'unknown_effect', 'fit_broken'],
    classes=list[
        figures('probability', members=Words, best=str, parameters=dict[str, Interval],
                holdout_rmse_um=dict[str, Number])
    ],
    rmse_um=figures(
        'before after holdout_before holdout_after holdout_after_refitted noise_floor',
        left_out=Literal['experiments', 'points'],
    ),
    experiments=list[figures('rmse_before_um rmse_after_um', name=str)],
    footprint=dict | None, regions=list[Region],
    next=figures(measure=list[dict], spray=list[figures(what=str, separates=Words)]),
)  # fmt: skip
# By command; of any other its JSON is ``ANY``.
OUTPUTS: dict[str, type[BaseModel]] = {
    'simulate': figures('spraying_time_s', create_model('All', __base__=(Film, ANY))),
    'calibrate': figures(base=ANY, parameters=dict[str, figures('value sigma low high')]),
    'diagnose': Diagnosis,
    'refit': Diagnosis,
    'recommend': figures(
        'index_m sigma_n tolerance mean_um speed_m_per_s cycle_time_s', ANY, index_range_m=Pair,
        windows_m=list[Pair], minima=list[figures('index_m sigma_n')], passes=int | None,
        travel=Literal['alternating', 'one_way'],
        curve=figures(index_m=list[Number], sigma_n=list[Number]),
    ),
    'plan': figures('cycle_time_s sigma_n', ANY, passes=int, film=Film),
    'doctor': figures(well=bool, findings=list[figures(name=str, found=str, remedy=str)]),
    'improve': figures(base=ANY, sigma_n=BeforeAfter, mean_um=BeforeAfter),
}  # fmt: skip
