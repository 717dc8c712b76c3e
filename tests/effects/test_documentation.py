"""docs/own_effect.md names what an effect of one's own may use."""

from pathlib import Path

from booth import SAMPLES
from paint_deposition.effects.base import Effect
from paint_deposition.kernel.laws import Ray


def test_how_to_write_ones_own_names_what_there_is(repository: Path):
    text = (repository / 'docs/own_effect.md').read_text(encoding='utf-8')
    assert (SAMPLES / 'my_effect.py').relative_to(repository).as_posix() in text
    for name in Ray._fields:
        assert f'`{name}`' in text
    for place in ('flux_factor', 'pattern_scale', 'on_path', 'on_film', 'on_gauge'):
        assert f'`{place}(' in text
        assert hasattr(Effect, place)
