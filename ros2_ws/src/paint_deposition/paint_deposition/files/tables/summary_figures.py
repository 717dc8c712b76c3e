"""Statistics that gauges and people write below their readings."""

import re
import statistics
from collections.abc import Sequence

STATISTIC = re.compile(
    r'(mean|average|avg|mittel\w*|mw|median|std|sd|stand\w+|min\w*|max\w*|range|spannweite|cv|'
    r'lowest|highest|(high|low|upper|lower) limit|coef\w*|vari\w*|statist\w*|number of|count|'
    r'anzahl|sum|total|moyenne|ecart|n|s|x)\b'
)
FEWEST_READINGS = 3
MOST_FIGURES = 6


def figures_at_end(texts: Sequence[str]) -> str:
    """In words the last of these numbers if they are statistics of the rest; else ''.

    One of them is the mean of the rest, as exactly as it is written.
    """
    values = [float(text) for text in texts]
    decimals = [len(text.partition('.')[2]) for text in texts]
    for count in range(min(MOST_FIGURES, len(values) - FEWEST_READINGS), 0, -1):
        before = values[:-count]
        least, most = min(before), max(before)
        if least == most:
            continue
        means = {statistics.fmean(before)}
        figures = means | {
            statistics.stdev(before), statistics.pstdev(before), statistics.median(before),
            least, most, most - least, sum(before), float(len(before)),
        }  # fmt: skip

        def are(known: set[float], count: int = count) -> list[bool]:
            """Which of the last numbers is one of these."""
            finest = max(decimals[:-count])
            half = [0.5 * 10.0 ** -max(d, finest) + 1e-9 for d in decimals[-count:]]
            last = zip(values[-count:], half, strict=True)
            return [any(abs(v - one) <= near for one in known) for v, near in last]

        if any(are(means)) and all(are(figures)):
            named = ', '.join(texts[-count:])
            last = f'its last {count} values' if count > 1 else 'its last value'
            return (
                f'{last}, {named}, may be {"statistics" if count > 1 else "the mean"} of the rest'
            )
    return ''
