"""What the diagnosis got right on the virtual paint shop, beside what is aimed at."""

import numpy as np
from scipy.stats import beta

from paint_deposition.effects.catalogue import EFFECTS

NAMED = 0.8


def table(records: list[dict]) -> str:
    """The scores as lines, each with its 95 % interval and the target where there is one."""
    sound = [r for r in records if 'error' not in r]
    lines = [f'{len(records)} campaigns, {len(records) - len(sound)} errors']
    for label, hits, target in _shares(sound):
        lines.append(f'{label:<47}{_share(hits):<38}{target}')
    return '\n'.join([*lines, *_figures(sound)])


def _shares(records: list[dict]) -> list[tuple[str, list[bool], str]]:
    """Rows of label, hits and target."""
    clean = [r for r in records if not r['truth']]
    hidden = [r for r in records if r['truth'] in EFFECTS]
    pairs = _seen([r for r in records if '+' in r['truth']])
    footprint = _seen([r for r in records if r['truth'].startswith('footprint:')])
    strange = _seen([r for r in records if r['truth'].startswith('unknown:')])
    seen = _seen(hidden)
    bic = [r for r in hidden if r['bic']['chosen']]
    amounts = [a for r in hidden for a in r['amounts']]
    without = [r['without'] for r in hidden if 'without' in r]
    left = [w for w in without if w['verdict'] != 'none_missing']
    named = [r for r in seen if r['accepted']]
    return [
        ('false alarms on clean data', [r['verdict'] != 'none_missing' for r in clean], '<= 7'),
        ('  stepwise BIC', [bool(r['bic']['chosen']) for r in clean], ''),
        ('effects detected', [r['verdict'] != 'none_missing' for r in hidden], ''),
        ('  stepwise BIC', [bool(r['bic']['chosen']) for r in hidden], ''),
        ('right effect in a class reported', [_listed(r) for r in seen], '>= 90'),
        ('  in the class named, or else listed first', [_first(r) for r in seen], ''),
        ('  in the class named, where one is', [_first(r) for r in named], ''),
        ('  stepwise BIC, first named', [r['bic']['chosen'][0] == r['truth'] for r in bic], ''),
        ('wrong effect above 0.8, effects', [_wrong(r) for r in seen], '<= 3'),
        (
            'wrong effect above 0.8, all causes',
            [_wrong(r) for r in (*seen, *footprint, *strange, *pairs)],
            '',
        ),
        (
            'class removed: unknown or undecided',
            [w['verdict'] in ('unknown_effect', 'undecided') for w in left],
            '>= 85',
        ),
        ('cause in no library: not blamed', [not r['accepted'] for r in strange], ''),
        ('footprint: not blamed on physics', [not r['accepted'] for r in footprint], ''),
        ('  recognised as the footprint', [r['unknown'] == 'footprint' for r in footprint], ''),
        ('two effects: one or both named', [_named_of_pair(r) > 0 for r in pairs], ''),
        ('  both named', [_named_of_pair(r) > 1 for r in pairs], ''),
        (
            '95 % intervals hold the true amount',
            [a['low'] <= a['true'] <= a['high'] for a in amounts],
            '90 to 98',
        ),
    ]


def _figures(records: list[dict]) -> list[str]:
    added = [r for r in records if r['truth'] in EFFECTS and r['accepted'] and _listed(r)]
    lines = []
    if added:
        before, after = ([r['heldout'][name] for r in added] for name in ('before', 'after'))
        lines.append(
            f'unseen readings, RMSE over noise               {np.median(before):.2f} before, '
            f'{np.median(after):.2f} after; 90 % below {np.quantile(after, 0.9):.2f}   <= 1.15'
        )
    seconds = [r['seconds'] for r in records]
    if seconds:
        lines.append(
            f'seconds a diagnosis                            {np.median(seconds):.1f} median, '
            f'{max(seconds):.1f} longest                  <= 30'
        )
    return lines


def _share(hits: list[bool]) -> str:
    """A share with its 95 % Clopper-Pearson interval."""
    total, count = len(hits), sum(hits)
    if total == 0:
        return 'none'
    low = beta.ppf(0.025, count, total - count + 1) if count else 0.0
    high = beta.ppf(0.975, count + 1, total - count) if count < total else 1.0
    share = f'{100.0 * count / total:5.1f} %'
    return f'{share}  [{100 * low:.1f}, {100 * high:.1f}]  {count}/{total}'


def _seen(records: list[dict]) -> list[dict]:
    return [r for r in records if r['verdict'] != 'none_missing']


def _truths(record: dict) -> set[str]:
    return set(record['truth'].split('+'))


def _listed(record: dict) -> bool:
    return any(_truths(record) & set(members) for members, _ in record['classes'])


def _first(record: dict) -> bool:
    return bool(record['classes']) and bool(_truths(record) & set(record['classes'][0][0]))


def _wrong(record: dict) -> bool:
    """Whether an effect was named that has nothing to do with the truth."""
    return any(
        probability > NAMED
        and set(members) & set(record['accepted'])
        and not _truths(record) & set(members)
        for members, probability in record['classes']
    )


def _named_of_pair(record: dict) -> int:
    named = [set(m) for m, _ in record['classes'] if set(m) & set(record['accepted'])]
    return sum(any(truth in members for members in named) for truth in _truths(record))
