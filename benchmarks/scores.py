"""What the diagnosis got right on the painted campaigns, beside what is aimed at.

Intervals are 95 %: of shares those of Clopper and Pearson, of other figures bootstrapped.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.stats import beta, chi2, ncx2

RESAMPLED = 2000
STRONG = 8.0
LEVEL = 0.05
STRENGTHS = ((0.0, 2.0), (2.0, 4.0), (4.0, 8.0), (8.0, 16.0), (16.0, 32.0), (32.0, np.inf))
STATED = (0.05, 0.2, 0.4, 0.6, 0.8, 0.95, 1.001)
SURE = 0.95
MANY = 50
WIDTH = 52

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
        low, high = interval(self.values, self.statistic)
        values = np.array([value for _, value in self.values], dtype=float)
        if self.statistic is None:
            text = f'{100 * values.mean():5.1f} %  [{100 * low:.1f}, {100 * high:.1f}]'
        else:
            text = f'{self.statistic(values):6.2f}  [{low:.2f}, {high:.2f}]'
        campaigns = len({case for case, _ in self.values})
        count = f'{len(self.values)} in {campaigns}'
        return f'{self.label:<{WIDTH}}{text:<26}{count:<14}{self.aim}'.rstrip()


def interval(
    values: Values, statistic: Callable[[np.ndarray], float] | None = None
) -> tuple[float, float]:
    """95 % interval of a statistic, by default the mean.

    Values of one campaign are not independent: campaigns are resampled. Yes or no once a campaign
    is a share of independent trials (Clopper and Pearson), and so is never or always.
    """
    cases: dict[str, list[float]] = {}
    for case, value in values:
        cases.setdefault(case, []).append(float(value))
    groups = [np.array(group) for group in cases.values()]
    every = np.concatenate(groups)
    once = len(every) == len(groups) and np.isin(every, (0.0, 1.0)).all()
    if statistic is None and (once or np.all(every == 0.0) or np.all(every == 1.0)):
        trials, hits = len(groups), round(every.mean() * len(groups))
        low = beta.ppf(0.025, hits, trials - hits + 1) if hits else 0.0
        high = beta.ppf(0.975, hits + 1, trials - hits) if hits < trials else 1.0
        return float(low), float(high)
    rng = np.random.default_rng(0)
    picks = rng.integers(len(groups), size=(RESAMPLED, len(groups)))
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
    lines = [f'{len(records)} campaigns, {len(records) - len(sound)} errors']
    for part in (calibration, false_alarms, detection, naming, mistakes, errors_left, figures):
        lines += ['', *map(str, part(sound))]
    return '\n'.join([*lines, '', *reliability(sound)])


def calibration(records: list[Record]) -> list[Row | str]:
    """Expected calibration error in all and in each world, and what was said with certainty."""
    worlds = sorted({r['world'] for r in records})
    rows: list[Row | str] = []
    for label, chosen in (
        ('expected calibration error', records),
        *((f'  {world}', [r for r in records if r['world'] == world]) for world in worlds),
    ):
        error, count = expected_calibration_error(chosen)
        aim = '<= 0.05' if label[0] != ' ' else ''
        chance = f'by chance {error_by_chance(chosen):.3f}'
        rows.append(f'{label:<{WIDTH}}{error:6.3f}  {chance:<18}{count} groups     {aim}'.rstrip())
        sure = [(c, right) for c, p, right in stated(chosen) if p >= SURE]
        rows.append(Row(f'{label[: len(label) - len(label.lstrip())]}  said with {SURE} and right',
                        sure, '>= 93'))  # fmt: skip
    return rows


def stated(records: list[Record]) -> list[tuple[str, float, bool]]:
    """Campaign, stated probability, and whether it was right, of each group of named effects."""
    return [
        (r['case'], probability, bool(set(members) & set(r['hidden'])))
        for r in records
        for members, probability, *_ in r['classes']
        if not members[0].startswith('learned:') and probability >= STATED[0]
    ]


def bins(records: list[Record]) -> list[tuple[float, float, list[tuple[str, float, bool]]]]:
    """The groups of each range of stated probability."""
    every = stated(records)
    return [
        (low, high, [one for one in every if low <= one[1] < high])
        for low, high in pairwise(STATED)
    ]


def expected_calibration_error(records: list[Record]) -> tuple[float, int]:
    """Mean distance of stated probability and share that was right, over bins; groups counted."""
    total, count = 0.0, 0
    for _, _, chosen in bins(records):
        if chosen:
            apart = np.mean([p for _, p, _ in chosen]) - np.mean([right for *_, right in chosen])
            total, count = total + abs(apart) * len(chosen), count + len(chosen)
    return (total / count if count else float('nan')), count


def error_by_chance(records: list[Record]) -> float:
    """The calibration error that as many groups have on average where what is said is true."""
    rng, apart, count = np.random.default_rng(0), 0.0, 0
    for _, _, chosen in bins(records):
        if chosen:
            said = np.array([probability for _, probability, _ in chosen])
            right = rng.random((RESAMPLED, len(said))) < said
            apart += len(said) * np.abs(right.mean(axis=1) - said.mean()).mean()
            count += len(said)
    return apart / count if count else float('nan')


def false_alarms(records: list[Record]) -> list[Row]:
    clean = [r for r in records if r['kind'] == 'clean']
    rows = [_alarms('false alarms', clean, '<= 5')]
    rows += [
        _alarms(f'  noise from {source}', [r for r in clean if r['facts']['noise_from'] == source])
        for source in ('stated', 'repeats', 'nothing')
    ]
    rows += [
        _alarms(f'  {world}', [r for r in clean if r['world'] == world])
        for world in sorted({r['world'] for r in clean})
    ]
    rows.append(Row('  with an effect named', [(r['case'], bool(wrong(r))) for r in clean]))
    return rows


def _alarms(label: str, chosen: list[Record], aim: str = '') -> Row:
    return Row(label, [(r['case'], r['verdict'] != 'none_missing') for r in chosen], aim)


def detection(records: list[Record]) -> list[Row | str]:
    hidden = [r for r in records if r['kind'] not in ('clean', 'footprint')]
    seen = sum(detected(r) for r in hidden)
    expected = float(sum(_power(r['strength']) for r in hidden))
    label = 'detected, of what an oracle would detect'
    rows: list[Row | str] = [f'{label:<{WIDTH}}{seen} of {expected:.1f}'] if hidden else []
    for low, high in STRENGTHS:
        chosen = [(r['case'], detected(r)) for r in hidden if low <= r['strength'] < high]
        rows.append(Row(f'  detected at {low:g} to {high:g} sd', chosen))
    broken = [(r['case'], r['verdict'] == 'fit_broken') for r in records]
    return [*rows, Row('fit called broken', broken)]


def _power(strength: float) -> float:
    """How often one who knows the mark, and not its size, detects it at the usual level."""
    return float(ncx2.sf(chi2.isf(LEVEL, 1), 1, strength**2))


def naming(records: list[Record]) -> list[Row]:
    alone = [r for r in records if r['kind'] == 'effect']
    strong = [r for r in alone if r['strength'] >= STRONG]
    rows = [
        Row('effect in the group named, over 8 sd', _named(strong), '>= 90'),
        Row('  named or listed', [(r['case'], listed(r)) for r in strong]),
    ]
    for low, high in STRENGTHS:
        chosen = [r for r in alone if low <= r['strength'] < high]
        rows.append(Row(f'  named at {low:g} to {high:g} sd', _named(chosen)))
    rows += [
        Row(f'  {world}', _named([r for r in strong if r['world'] == world]))
        for world in sorted({r['world'] for r in strong})
    ]
    pairs = [r for r in records if r['kind'] == 'pair' and min(r['strengths']) >= STRONG]
    both = [(r['case'], named_all(r)) for r in pairs]
    return [*rows, Row('both of two effects, each over 8 sd', both, '>= 75'),
            Row('  at least one', _named(pairs))]  # fmt: skip


def mistakes(records: list[Record]) -> list[Row]:
    def wrongly(chosen: list[Record]) -> Values:
        return [(r['case'], len(wrong(r))) for r in chosen]

    rows = [Row('wrong effects accepted, per campaign', wrongly(records), '<= 3')]
    for by in ('kind', 'world'):
        rows += [
            Row(f'  {value}', wrongly([r for r in records if r[by] == value]))
            for value in sorted({r[by] for r in records})
        ]
    for kind, aim in (('unknown', '<= 5'), ('footprint', '')):
        blamed = [(r['case'], bool(wrong(r))) for r in records if r['kind'] == kind]
        rows.append(Row(f'{kind} cause blamed on an effect', blamed, aim))
    return rows


def errors_left(records: list[Record]) -> list[Row]:
    strong = [r for r in records if r['kind'] != 'clean' and r['strength'] >= STRONG]
    before, after = ([(r['case'], r['unseen'][k]) for r in strong] for k in (0, -1))
    low = [(case, ratio <= 1.15) for case, ratio in after]
    rows = [
        Row('error over noise <= 1.15 after, over 8 sd', low, '>= 80'),
        Row('  median before', before, '', np.median),
        Row('  median after', after, '', np.median),
    ]
    for kind in ('effect', 'pair', 'unknown', 'footprint', 'clean'):
        # A strange footprint and nothing hidden have no strength.
        chosen = strong if kind in ('effect', 'pair', 'unknown') else records
        errors = [(r['case'], r['unseen'][-1]) for r in chosen if r['kind'] == kind]
        aim = '<= 1.6' if kind == 'unknown' else ''
        rows.append(Row(f'  {kind}, median after', errors, aim, np.median))
    worse = [(r['case'], r['unseen'][-1] > 1.02 * r['unseen'][0]) for r in records]
    return [*rows, Row('error on unseen points got worse', worse)]


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
    lines = ['groups by stated probability                        right']
    for low, high, chosen in bins(records):
        label = f'  {low:.2f} to {min(high, 1.0):.2f}'
        if not chosen:
            lines.append(f'{label:<{WIDTH}}none')
            continue
        mean = np.mean([p for _, p, _ in chosen])
        apart = 100.0 * abs(mean - np.mean([right for *_, right in chosen]))
        row = Row(f'{label}, mean {mean:.2f}', [(case, right) for case, _, right in chosen])
        few = '' if len(chosen) >= MANY else f', fewer than {MANY}'
        lines.append(f'{row!s:<{WIDTH + 40}}apart by {apart:.0f} points{few}')
    return lines


def reliability_diagram(records: list[Record], file: Path) -> None:
    """Draw stated probability against the share that was right, with intervals and counts."""
    import matplotlib as mpl

    mpl.use('Agg')
    from matplotlib import pyplot as plt

    sound = [r for r in records if 'error' not in r]
    worlds = sorted({r['world'] for r in sound})
    figure, axes = plt.subplots(figsize=(5.2, 5.2), layout='constrained')
    axes.plot([0, 1], [0, 1], color='0.6', linewidth=1, zorder=0)
    for world in worlds:
        places, shares = _points([r for r in sound if r['world'] == world])[:2]
        axes.plot(places, shares, 'o-', markersize=3.5, linewidth=0.8, alpha=0.7, label=world)
    places, shares, lows, highs, counts = _points(sound)
    error, count = expected_calibration_error(sound)
    spread = [np.subtract(shares, lows), np.subtract(highs, shares)]
    axes.errorbar(places, shares, spread, fmt='ks-', markersize=6, capsize=3, label='all')
    for place, share, number in zip(places, shares, counts, strict=True):
        axes.annotate(
            f'{number}', (place, share), (7, -11), textcoords='offset points', fontsize=8
        )
    axes.set(xlim=(0, 1.08), ylim=(-0.02, 1.02), aspect='equal')
    axes.set(xlabel='stated probability of a group', ylabel='share that was right')
    axes.set_title(f'{len(sound)} campaigns, {count} groups: calibration error {error:.3f}')
    axes.legend(loc='upper left', frameon=False)
    figure.savefig(file, dpi=150)
    plt.close(figure)


def _points(records: list[Record]) -> tuple[list, list, list, list, list]:
    """Of each bin that is not empty: mean stated, share right, its interval, how many."""
    found = []
    for _, _, chosen in bins(records):
        if chosen:
            low, high = interval([(case, right) for case, _, right in chosen])
            share = float(np.mean([right for *_, right in chosen]))
            mean = float(np.mean([p for _, p, _ in chosen]))
            found.append((mean, share, min(low, share), max(high, share), len(chosen)))
    return tuple(list(column) for column in zip(*found, strict=True)) or ([], [], [], [], [])


def failures(records: list[Record]) -> str:
    """A line for each strong cause that was not named and for each wrong effect accepted."""
    lines = []
    for r in sorted(records, key=lambda r: (r['kind'], r['case'])):
        if 'error' in r:
            lines.append(f'{r["case"]}: {r["error"]}')
            continue
        missed = r['strength'] >= STRONG and not (
            named_all(r) if r['kind'] in ('effect', 'pair') else detected(r)
        )
        alarm = r['kind'] == 'clean' and detected(r)
        if wrong(r) or missed or alarm:
            said = ', '.join(f'{"/".join(m)} {p:.2f}' for m, p, *_ in r['classes'][:3])
            lines.append(
                f'{r["case"]} {"+".join(r["hidden"])}: {r["strength"]:.0f} sd, '
                f'{r["readings"]} readings, {r["facts"]["shape"]}, {r["facts"]["noise_from"]}: '
                f'{r["verdict"]}, accepted {"+".join(r["accepted"]) or "nothing"}; '
                f'{said or "no group"}; unseen {r["unseen"][0]:.2f} -> {r["unseen"][-1]:.2f}'
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
        for members, _, best in record['classes']
        if best in accepted and not best.startswith('learned:')
    ]


def named_all(record: Record) -> bool:
    """Whether every hidden effect is in an accepted group of its own.

    Two effects that the readings cannot tell apart may share a group.
    """
    found = [group & set(record['hidden']) for group in groups(record)]
    return set(record['hidden']) <= set().union(*found)


def listed(record: Record) -> bool:
    """Whether a hidden effect is in any group reported."""
    return any(set(members) & set(record['hidden']) for members, *_ in record['classes'])


def wrong(record: Record) -> list[set[str]]:
    """Accepted groups with none of the hidden effects in them."""
    return [group for group in groups(record) if not group & set(record['hidden'])]


def _named(records: list[Record]) -> Values:
    return [(r['case'], any(group & set(r['hidden']) for group in groups(r))) for r in records]
