"""The JSON of each command: keys that stay and the types of their values; more may be added.

Lengths are in m, times in s, angles in rad unless the name says otherwise, films in um; null is a
number that is not known.
"""

# The types are made by functions, which mypy cannot follow.
# mypy: ignore-errors

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, create_model

from paint_deposition.planning.requests import ImproveRequest

Number = float | None
Count = Annotated[int, Field(ge=0)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Sha256 = Annotated[str, Field(pattern='^[0-9a-f]{64}$')]
Direction = Annotated[list[float], Field(min_length=3, max_length=3)]
Pose = Annotated[list[float], Field(min_length=7, max_length=7)]
Pair = Annotated[list[Number], Field(min_length=2, max_length=2)]
Words = list[str]
OUTPUTS: dict[str, type[BaseModel]] = {}


class Figures(BaseModel):
    """Base of all: numbers are numbers, and keys that are not named here are let through."""

    model_config = ConfigDict(strict=True, extra='allow')


def each(kind: Any, names: str) -> dict[str, Any]:
    """Fields of one type."""
    return dict.fromkeys(names.split(), kind)


def figures(numbers: str = '', /, *bases: Any, **fields: Any) -> Any:
    """A JSON object with these numbers, which may be null, and fields of other types."""
    kinds = each(Number, numbers) | fields
    required = {name: (kind, ...) for name, kind in kinds.items()}
    return create_model('Figures', __base__=bases or (Figures,), **required)


def output(name: str, numbers: str = '', /, *bases: Any, **fields: Any) -> Any:
    """The whole JSON of a command."""
    OUTPUTS[name] = figures(numbers, *bases, **fields, provenance=Provenance)
    return OUTPUTS[name]


Interval = figures('value low high')


class WithForms(Figures):
    """A learned law also has the closed forms that fit it."""

    forms: list[figures('probability', formula=str, parameters=dict[str, Interval])] | None = None


Model = figures(projection=dict, effects=list[figures(id=str)], sha256=Sha256)
Provenance = figures(
    package_version=str, git_version=str, campaign=str, models=dict[str, Model],
    files=list[figures(what=str, file=str, sha256=Sha256)],
)  # fmt: skip
Film = figures(
    'mean_um std_dev_um min_um max_um coverage below_target within_target above_target cpk '
    'painted_volume_cm3 capture_fraction emitted_volume_cm3 area_m2 painted_above_um target_um '
    'target_tolerance_um'
)
Paint = figures(
    'wet_cm3 mass_g solids_cm3 transfer_efficiency mean_wet_film_um',
    spraying_time_s_by_brush=dict[str, float],
)
Poses = figures(
    **each(
        int, 'received repeated_stamps backward_stamps not_finite not_unit_quaternions restarts '
        'gaps longest_gap_ns late_triggers rejected'
    )
)  # fmt: skip
Noise = figures('sigma_um texture_share', source=str, texture_source=str)
Region = figures('mean_residual_um', description=str, experiment=str, readings=int)
BeforeAfter = figures('before after')
Inputs = figures(mesh_file=str, trajectory=str, notes=Words)

output(
    'stats', 'spraying_time_s', Film, Inputs, frame_id=str, down=Direction, effects=Words,
    atomizers=list[
        figures('painted_volume_cm3 emitted_volume_cm3', name=str, trajectory=str)
    ],
    poses=Poses, model_file=str, paint=Paint | None,
)  # fmt: skip
output(
    'gun_on_part', 'area_m2', Inputs, frame_id=str, down=Direction, poses=Poses,
    geometry=figures(passes=int, sentence=str, warnings=Words), picture=str | None,
)  # fmt: skip

output(
    'recording', path=str, triggers=Words,
    topics=list[figures(name=str, type=str, message_count=int)],
    pose_streams=list[
        figures(
            'duration_s mean_rate_hz longest_gap_s', topic=str, frame_id=str, poses=int, gaps=int,
            repeated_stamps=int, backward_stamps=int,
        )
    ],
)  # fmt: skip
output('pose_table', 'duration_s', poses=int, frame_id=str, low_m=Direction, high_m=Direction,
       notes=Words)  # fmt: skip
output(
    'program', module=str, gun_signal=str, notes=Words,
    moves=list[
        figures(
            'speed_m_per_s zone_m', instruction=str, line=int, position_m=list[Number],
            quaternion_xyzw=list[Number], via_m=list | None, tool=str, work_object=str,
            spraying=bool, switches=list,
        )
    ],
)  # fmt: skip
output('recovery', folder=str, messages=int, topics=dict[str, int], damaged_chunks=int,
       breaks=Words, skipped_topics=Words)  # fmt: skip
output('location', 'rms_m', part_pose=Pose, residuals_m=dict[str, float], warnings=Words)

Residuals = figures(
    '', readings=int, noise=Noise, left_out=list[dict], notes=Words,
    misfits=list[
        figures('bias_um rmse_um std_um chi_square_per_reading p_value', experiment=str, kind=str,
                label=str, readings=int)
    ],
    regions=list[Region], dependences=list[figures('correlation p_value', covariate=str)],
)  # fmt: skip
output('comparison', '', Residuals)
output('side_by_side', best=str, models=list[figures('rmse_um', Residuals, name=str)])
output(
    'calibration', 'chi_square_per_degree_of_freedom', points=int, readings=int, converged=bool,
    parameters=dict[str, figures('value sigma low high', determined=bool)],
    correlations=list[figures('value', parameters=Words)],
    experiments=list[
        figures('measured_mean_um predicted_mean_um residual_sd_um rmse_um', experiment=str,
                points=int)
    ],
    collapse=list[
        figures('K1_um_m K2_um_m K3_um_m r1_m r2_m sigma1_m sigma2_m sigma3_m index_m sigma_n '
                'rmse_um speed_m_per_s') | None
    ],
    noise=Noise, left_out=list[dict], warnings=Words,
)  # fmt: skip
output(
    'diagnosis', 'p_value', reason=str, accepted=Words, unknown=dict | None, not_testable=Words,
    verdict=Literal['none_missing', 'effect_missing', 'undecided', 'unknown_effect', 'fit_broken'],
    classes=list[
        figures('probability', WithForms, members=Words, best=str, parameters=dict[str, Interval],
                holdout_rmse_um=dict[str, Number])
    ],
    rmse_um=figures(
        'before after holdout_before holdout_after noise_floor',
        left_out=Literal['experiments', 'points'],
    ),
    experiments=list[figures('rmse_before_um rmse_after_um', name=str)],
    remainder=dict | None, footprint=dict | None, worse=Words,
    detectable=dict[str, dict[str, Number]], regions=list[Region], noise=Noise,
    next=figures(measure=list[dict], spray=list[figures(what=str, separates=Words)]),
    pattern_shift=dict | None, left_out=list[dict], notes=Words,
    random_effects=list[figures('value sd', kind=str, of=str, unit=str)],
)  # fmt: skip

output(
    'recommendation',
    'index_m sigma_n tolerance mean_um speed_m_per_s target_um cycle_time_s width_m length_m '
    'half_width_m travel_rad standoff_m',
    index_range_m=Pair, windows_m=list[Pair], minima=list[figures('index_m sigma_n')],
    passes=int | None, index_drift_m=list | None, standoff_drift_m=list | None, notes=Words,
    travel=str, gun_turns=bool, assumption=str,
    curve=figures(index_m=list[Number], sigma_n=list[Number]),
)  # fmt: skip
Planned = figures(
    'cycle_time_s sprayed_m sigma_n', direction=str, passes=int, film=Film, down=Direction,
    notes=Words, mesh=str, model=str, frame_id=str, paint=Paint | None,
)  # fmt: skip
output(
    'plan',
    'index_m speed_m_per_s standoff_m overspray_m acceleration_m_per_s2 smoothing_radius_m',
    Planned, lines_m=list[Number], travel=str,
    gun_turns=bool,
    plain=figures('sigma_n mean_um paint_cm3 capture_fraction cycle_time_s', passes=int) | None,
    plane=figures('index_m sigma_n sigma_n_on_part', passes=int),
)  # fmt: skip
output(
    'plan_of_faces', 'margin_m sigma_n_unblended', Planned, speeds_m_per_s=list[float],
    faces=list[figures('area_m2', outward=Direction)],
    gun=figures('radius_m length_m before_m'),
    contacts=list[figures('begin_s end_s depth_m', place_m=Direction, by_gun=bool)],
)  # fmt: skip
output(
    'improvement',
    'target_um tolerance target_region_m2 area_m2 sigma_n_of_path program_difference',
    **each(
        BeforeAfter,
        'mean_um sigma_n min_um max_um within paint_cm3 on_part_cm3 spraying_s cycle_s',
    ),
    binding_limits=list[figures('sigma_n', name=str)],
    passes=list[
        figures('opens_earlier_m closes_later_m opens_earlier_s closes_later_s', number=int,
                flow=Pair, sentence=str,
                speed_m_per_s=Pair)
    ],
    request=ImproveRequest,
    sentence=str, model_sha256=Sha256, notes=Words, warnings=Words,
)  # fmt: skip
Point = figures(
    'x_m y_m z_m from_left_m height_m expected_um sigma_um', point=str, normal=Direction,
    speaks_for=Words,
)  # fmt: skip
output(
    'measurement', 'foot_m apart_m', Inputs, model_file=str, down=Direction, points=list[Point],
    read_twice=Words, power=list[figures(effect=str, chosen=Share, grid=Share)],
    mean_power=figures(chosen=Share, grid=Share),
)  # fmt: skip

output(
    'sweep', cases=Count, computed=Count, workers=str, varied=Words, judged_by=str | None,
    figures=dict[str, figures('median low_5 high_95')],
    best=figures(case=Count, values=dict) | None, errors=list[figures(case=int, error=str)],
    notes=Words,
)  # fmt: skip
Series = figures(series=str, unit=str, members=Words)
output(
    'line', parts=Count, measured=Count, points=Count, computed=Count, workers=str,
    first=str | None, last=str | None, without_run=Words,
    pooled=figures(
        'level_sd_percent noise_factor misfit_share',
        causes=list[
            figures('value sd probability all_parts', effect=str, parameter=str,
                    unit=str, members=Words)
        ],
    ) | None,
    charts=list[
        figures('centre', Series, baseline_parts=Count, limits=figures('shewhart ewma'),
                alarms=figures(shewhart=Words, ewma=Words))
    ],
    false_alarms=figures('one_in_parts'),
    changes=list[
        figures('before after sd per_day strength', Series, kind=Literal['step', 'drift'],
                part=Count, time=str, earliest=str, latest=str, sentence=str, also=Words)
    ],
    errors=list[figures(run=str, error=str)], remarks=list[figures(part=str, remark=str)],
)  # fmt: skip
