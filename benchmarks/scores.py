"""What the diagnosis got right on the virtual paint shop, beside what is aimed at.

Intervals are 95 % and clustered: draws of one campaign share its geometry and film, so that
campaigns are resampled, not draws.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.stats import beta

RESAMPLED = 2000
STRONG = 8.0
LEVEL = 0.05
STRENGTHS = ((0.0, 2.0), (2.0, 4.0), (4.0, 8.0), (8.0, 16.0), (16.0, 32.0), (32.0, np.inf))
READINGS = ((0, 80), (80, 160), (160, 500))
MESH_EDGES_MM = ((3, 6), (6, 15))
STATED = (0.05, 0.2, 0.4, 0.6, 0.8, 0.95, 1.001)
WIDTH = 52

KINDS = ('clean', 'effect', 'pair', 'unknown', 'footprint')

Record = dict
Values = Sequence[tuple[str, float]]


@dataclass(frozen=True)
class Row:
    """A line of the table: what is counted, values with their campaigns, the aim, a statistic."""

    label: str
    values: Values
    aim: str = ''
    statistic: Callable[[np.ndarray], float] | None = None  # default: the share of hits

    def __str__(self) -> str:
        if not self.values:
            return f'{self.label:<{WIDTH}}none'
        campaigns = len({case for case, _ in self.values})
        if self.statistic is None:
            low, high = interval(self.values)
            share = 100.0 * np.mean([v for _, v in self.values])
            text = f'{share:5.1f} %  [{100 * low:.1f}, {100 * high:.1f}]'
        else:
            low, high = interval(self.values, self.statistic)
            value = self.statistic(np.array([v for _, v in self.values]))
            text = f'{value:6.2f}  [{low:.2f}, {high:.2f}]'
        count = f'{len(self.values)} in {campaigns}'
        return f'{self.label:<{WIDTH}}{text:<26}{count:<12}{self.aim}'.rstrip()


def interval(
    values: Values, statistic: Callable[[np.ndarray], float] | None = None
) -> tuple[float, float]:
    """95 % bootstrap interval of a statistic, by default the mean, campaigns resampled.

    Where all values are 0 or all are 1 the bootstrap is blind; then that of as many independent
    trials as there are campaigns (Clopper and Pearson).
    """
    cases: dict[str, list[float]] = {}
    for case, value in values:
        cases.setdefault(case, []).append(value)
    groups = [np.array(group, dtype=float) for group in cases.values()]
    every = np.concatenate(groups)
    if statistic is None and np.all(every == 0.0):
        return 0.0, float(beta.ppf(0.975, 1, len(groups)))
    if statistic is None and np.all(every == 1.0):
        return float(beta.ppf(0.025, len(groups), 1)), 1.0
    rng = np.random.default_rng(0)
    picks = rng.integers(len(groups), size=(RESAMPLED, len(groups)))
    found: np.ndarray | list[float]
    if statistic is None:
        sums, counts = (np.array([of(group) for group in groups]) for of in (np.sum, np.size))
        found = sums[picks].sum(axis=1) / counts[picks].sum(axis=1)
    else:
        found = [statistic(np.concatenate([groups[k] for k in pick])) for pick in picks]
    low, high = np.quantile(found, [0.025, 0.975])
    return float(low), float(high)


def table(records: list[Record]) -> str:
    """The scores as lines, each with its interval, its numbers and the aim where there is one."""
    sound = [r for r in records if 'error' not in r]
    errors = len(records) - len(sound)
    campaigns = len({r['case'] for r in sound})
    head = f'{len(records)} diagnoses of {campaigns} campaigns, {errors} errors'
    parts = (false_alarms, detection, naming, mistakes, errors_left, figures)
    lines = [head]
    for part in parts:
        lines += ['', *map(str, part(sound))]
    return '\n'.join([*lines, '', *map(str, reliability(sound))])


def false_alarms(records: list[Record]) -> list[Row]:
    clean = [r for r in records if r['kind'] == 'clean']

    def row(label: str, chosen: list[Record], aim: str = '<= 5') -> Row:
        return Row(label, [(r['case'], r['verdict'] != 'none_missing') for r in chosen], aim)

    rows = [row('false alarms', clean)]
    for low, high in MESH_EDGES_MM:
        of_mesh = [r for r in clean if low <= 1000.0 * r['mesh_edge_m'] < high]
        rows.append(row(f'  mesh edges {low} to {high} mm', of_mesh))
    return [
        *rows,
        row('  noise stated', [r for r in clean if r['noise_from'] == 'stated']),
        row('  noise from repeats', [r for r in clean if r['noise_from'] == 'repeats']),
        row('  heavy tails', [r for r in clean if r['heavy_tails']], ''),
        row('  1 % mistyped', [r for r in clean if r['slips']], ''),
        Row('  stepwise BIC', [(r['case'], bool(r['bic'])) for r in clean]),
    ]


def detection(records: list[Record]) -> list[Row]:
    hidden = [r for r in records if r['kind'] != 'clean']
    seen = [r for r in hidden if r['oracle_p'] < LEVEL]
    rows = [
        Row('detected by the oracle', [(r['case'], r['oracle_p'] < LEVEL) for r in hidden]),
        Row('detected', [(r['case'], detected(r)) for r in hidden]),
        Row('  of what the oracle detects', [(r['case'], detected(r)) for r in seen], '>= 85'),
        Row('  stepwise BIC, of the same', [(r['case'], bool(r['bic'])) for r in seen]),
        Row('fit called broken', [(r['case'], r['verdict'] == 'fit_broken') for r in records]),
    ]
    for low, high in STRENGTHS:
        chosen = [(r['case'], detected(r)) for r in hidden if low <= r['strength'] < high]
        rows.append(Row(f'  detected at {low:g} to {high:g} sd', chosen))
    return rows


def naming(records: list[Record]) -> list[Row]:
    alone = [r for r in records if r['kind'] == 'effect']
    strong = [r for r in alone if r['strength'] >= STRONG]
    rows = [
        Row('effect in the group named, over 8 sd', _named(strong), '>= 90'),
        Row('  stepwise BIC, first chosen', _first(strong)),
        Row('  named or listed', [(r['case'], listed(r)) for r in strong]),
    ]
    for low, high in STRENGTHS:
        chosen = [r for r in alone if low <= r['strength'] < high]
        rows.append(Row(f'  named at {low:g} to {high:g} sd', _named(chosen)))
    for low, high in READINGS:
        chosen = [r for r in strong if low <= r['readings'] < high]
        rows.append(Row(f'  over 8 sd, {low} to {high} readings', _named(chosen)))
    pairs = [r for r in records if r['kind'] == 'pair' and min(r['strengths']) >= STRONG]
    both = [(r['case'], named(r) >= set(r['hidden'])) for r in pairs]
    one = [(r['case'], bool(named(r) & set(r['hidden']))) for r in pairs]
    chosen = [(r['case'], set(r['bic']) >= set(r['hidden'])) for r in pairs]
    rows.append(Row('both of two effects, each over 8 sd', both, '>= 75'))
    return [*rows, Row('  at least one', one), Row('  stepwise BIC, both', chosen)]


def mistakes(records: list[Record]) -> list[Row]:
    def wrongly(chosen: list[Record]) -> Values:
        return [(r['case'], len(wrong(r))) for r in chosen]

    def wrong_bic(chosen: list[Record]) -> Values:
        return [(r['case'], len(set(r['bic']) - set(r['hidden']))) for r in chosen]

    rows = [
        Row('wrong effects accepted, per campaign', wrongly(records), '<= 3'),
        Row('  stepwise BIC', wrong_bic(records)),
    ]
    rows += [
        Row(f'  {kind}', wrongly([r for r in records if r['kind'] == kind])) for kind in KINDS
    ]
    strange = [r for r in records if r['kind'] in ('unknown', 'footprint')]
    blamed = [(r['case'], bool(wrong(r))) for r in strange if r['kind'] == 'unknown']
    rows.append(Row('unknown cause blamed on an effect', blamed, '<= 5'))
    blamed = [(r['case'], bool(wrong(r))) for r in strange if r['kind'] == 'footprint']
    rows.append(Row('footprint blamed on an effect', blamed))
    right = [
        (r['case'], r['unknown'] == 'footprint')
        for r in strange
        if r['kind'] == 'footprint' and r['strength'] >= STRONG
    ]
    return [*rows, Row('footprint recognised, over 8 sd', right)]


def errors_left(records: list[Record]) -> list[Row]:
    strong = [r for r in records if r['kind'] != 'clean' and r['strength'] >= STRONG]
    before, after = ([(r['case'], r['unseen'][k]) for r in strong] for k in (0, -1))
    low = [(case, ratio <= 1.15) for case, ratio in after]
    known = [(r['case'], r['unseen_oracle']) for r in strong]
    beside = [(r['case'], r['unseen'][-1] / r['unseen_oracle']) for r in strong]
    rows = [
        Row('error over noise <= 1.15 after, over 8 sd', low, '>= 90'),
        Row('  median before', before, '', np.median),
        Row('  median after', after, '', np.median),
        Row('  90 % after', after, '<= 1.15', lambda v: float(np.quantile(v, 0.9))),
        Row('  the oracle: <= 1.15', [(case, ratio <= 1.15) for case, ratio in known]),
        Row('  the oracle: median', known, '', np.median),
        Row("  after over the oracle's, median", beside, '', np.median),
    ]
    for kind in ('effect', 'pair', 'unknown', 'footprint'):
        chosen = [(r['case'], r['unseen'][-1]) for r in strong if r['kind'] == kind]
        rows.append(Row(f'  {kind}, median after', chosen, '', np.median))
    weak = [(r['case'], r['unseen'][-1]) for r in records if r['kind'] == 'clean']
    return [*rows, Row('  clean, median after', weak, '', np.median)]


def figures(records: list[Record]) -> list[Row]:
    covered = [
        (r['case'], a['low'] <= a['true'] <= a['high']) for r in records for a in r['amounts']
    ]
    seconds = [(r['case'], r['seconds']) for r in records]
    return [
        Row('95 % intervals hold the true amount', covered, '90 to 98'),
        Row('seconds of processor a diagnosis, median', seconds, '', np.median),
        Row('  longest', seconds, '', np.max),
    ]


def reliability(records: list[Record]) -> list[str]:
    """Shares that were right among groups by their stated probability."""
    stated = [
        (r['case'], probability, bool(set(members) & set(r['hidden'])))
        for r in records
        for members, probability in r['classes']
        if not members[0].startswith('learned:')
    ]
    lines = ['groups by stated probability                        right']
    for low, high in pairwise(STATED):
        chosen = [(case, p, right) for case, p, right in stated if low <= p < high]
        label = f'  {low:.2f} to {min(high, 1.0):.2f}'
        if not chosen:
            lines.append(f'{label:<{WIDTH}}none')
            continue
        mean = np.mean([p for _, p, _ in chosen])
        apart = 100.0 * abs(mean - np.mean([right for _, _, right in chosen]))
        row = Row(f'{label}, mean {mean:.2f}', [(case, right) for case, _, right in chosen])
        lines.append(f'{row!s:<{WIDTH + 38}}apart by {apart:.0f} points  <= 5')
    return lines


def failures(records: list[Record]) -> str:
    """A line for each strong cause that was not named and for each wrong effect accepted."""
    lines = []
    for r in sorted(records, key=lambda r: (r['kind'], r['case'], r['redraw'])):
        if 'error' in r:
            lines.append(f'{r["case"]} ({r["redraw"]}): {r["error"]}')
            continue
        if r['kind'] == 'clean':
            failed = r['verdict'] != 'none_missing'
        else:
            of_library = r['kind'] in ('effect', 'pair')
            found = named(r) >= set(r['hidden']) if of_library else r['verdict'] != 'none_missing'
            failed = bool(wrong(r)) or (r['strength'] >= STRONG and not found)
        if failed:
            groups_said = ', '.join(f'{"/".join(m)} {p:.2f}' for m, p in r['classes'][:3])
            lines.append(
                f'{r["case"]} ({r["redraw"]}): {r["strength"]:.0f} sd, {r["readings"]} readings: '
                f'{r["verdict"]}, accepted {"+".join(r["accepted"]) or "nothing"}; '
                f'{groups_said or "no group"}; '
                f'unseen {r["unseen"][0]:.2f} -> {r["unseen"][-1]:.2f}'
            )
    return '\n'.join(lines)


def detected(record: Record) -> bool:
    """Whether the diagnosis says that something is missing."""
    return record['verdict'] not in ('none_missing', 'fit_broken')


def groups(record: Record) -> list[set[str]]:
    """Members of each accepted group of named effects."""
    accepted = set(record['accepted'])
    return [
        set(members)
        for members, _ in record['classes']
        if members[0] in accepted and not members[0].startswith('learned:')
    ]


def named(record: Record) -> set[str]:
    """All members of the accepted groups."""
    return set().union(*groups(record))


def listed(record: Record) -> bool:
    """Whether a hidden effect is in any group reported."""
    return any(set(members) & set(record['hidden']) for members, _ in record['classes'])


def wrong(record: Record) -> list[set[str]]:
    """Accepted groups with none of the hidden effects in them."""
    return [group for group in groups(record) if not group & set(record['hidden'])]


def _named(records: list[Record]) -> Values:
    return [(r['case'], bool(named(r) & set(r['hidden']))) for r in records]


def _first(records: list[Record]) -> Values:
    return [(r['case'], r['bic'][:1] == r['hidden']) for r in records]
