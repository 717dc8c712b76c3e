"""True amounts of hidden effects in the parameters of the model's laws.

Only effects of which truth and law mean the same by their parameters: errors of the tool, shifts
at the model plane, delays, levels and volumes, each in the form of its law that has the amount.
Attraction, shielding or losses follow laws of their own in the virtual paint shop, so their
parameters cannot be compared.
"""

import numpy as np

NAMES = {
    'flow_drift': 'drift_per_pass',
    'gauge_zero': 'offset_um',
    'gun_wake': 'lag_s',
    'overspray_fog': 'fog_um',
    'pose_lag': 'lag_s',
    'tcp_standoff': 'offset_z_m',
}
SAG_REFERENCE_UM = 20.0
# Other forms of a law that mean the same by their amount: a shift at the model plane.
SAME_AMOUNT = {'air_drift': ('square', 'carried'), 'gun_wake': ('even',)}


def true_amounts(hidden: dict, passes: list[int]) -> dict[str, float]:
    """Values of parameters, `effect.parameter`, that stand for a truth.

    None where the laws cannot be compared.

    Args:
        hidden: the truth's entry in ``truth.json``.
        passes: number of passes of each experiment.
    """
    amplitude, truth = hidden['amplitude'], hidden['id']
    if hidden['form'] and hidden['form'] not in SAME_AMOUNT.get(truth, ()):
        return {}
    found: dict[str, float] = {}
    if truth in ('tcp_offset', 'tcp_tilt'):
        angle = hidden['direction_rad' if truth == 'tcp_offset' else 'axis_rad']
        names = (
            ('offset_x_m', 'offset_y_m') if truth == 'tcp_offset' else ('tilt_x_rad', 'tilt_y_rad')
        )
        found = dict(zip(names, amplitude * np.array([np.cos(angle), np.sin(angle)]), strict=True))
    elif truth == 'air_drift':
        # The surface faces +y, so that its right side, seen by the gun, is -x.
        x, _, z = hidden['direction']
        found = {'shift_down_m': -amplitude * z, 'shift_across_m': -amplitude * x}
    elif truth == 'sag':
        found = {'run_m': amplitude / SAG_REFERENCE_UM}
    elif truth == 'flow_drift':
        found = {'drift_per_pass': np.mean([_growth(amplitude, n) for n in passes])}
    elif truth in NAMES:
        found = {NAMES[truth]: amplitude}
    return {f'{truth}.{name}': float(value) for name, value in found.items()}


def _growth(drift: float, passes: int) -> float:
    """Mean growth from pass to pass where the flow is linear about the middle of the job."""
    half = 0.5 * (passes - 1)
    return ((1.0 + drift * half) / (1.0 - drift * half)) ** (1.0 / (passes - 1)) - 1.0
