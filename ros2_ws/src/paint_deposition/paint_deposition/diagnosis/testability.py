"""What the readings can show at all: effects that do not show, and the smallest that would."""

from collections.abc import Sequence

import numpy as np

from paint_deposition.diagnosis.evidence import NullModel
from paint_deposition.diagnosis.explanations import Explanation
from paint_deposition.diagnosis.sensitivities import Sensitivity

# Smallest signal-to-noise ratio, at typical amplitude and with the pattern refitted, at which an
# effect counts as testable.
TESTABLE = 2.0
# Signal-to-noise ratio of an amplitude that is detected nine times in ten: three standard
# deviations against chance among all causes, and 1.3 more for the power.
DETECTED = 4.3


Testability = tuple[tuple[str, ...], dict[str, dict[str, float]]]


def testability(null: NullModel, explanations: Sequence[Explanation]) -> Testability:
    """Ids of effects that do not show, and detectable amplitudes of the others by parameter."""
    shapes: dict[str, list[Sensitivity]] = {}
    for explanation in explanations:
        if explanation.sensitivity is not None:
            shapes.setdefault(explanation.cause, []).append(explanation.sensitivity)
    not_testable, detectable = [], {}
    for effect_id, found in shapes.items():
        # Along the combination of amplitudes that shows most.
        if max(np.linalg.norm(null.whiten(s.columns), 2) for s in found) >= TESTABLE:
            detectable[effect_id] = _detectable(null, found)
        else:
            not_testable.append(effect_id)
    return tuple(not_testable), detectable


def _detectable(null: NullModel, shapes: list[Sensitivity]) -> dict[str, float]:
    """Smallest detectable amplitudes, for the shape that shows best, where physically possible."""
    info = type(shapes[0].effect).parameters()
    found = {}
    for k, name in enumerate(shapes[0].names):
        strength = max(float(np.linalg.norm(null.whiten(s.columns[:, [k]]))) for s in shapes)
        amount = DETECTED * info[name]['typical'] / max(strength, 1e-9)
        room = max(abs(info[name][end] - info[name]['neutral']) for end in ('low', 'high'))
        if amount <= room:
            found[name] = amount
    return found
