"""What a benchmark prints goes into its place on a page of the documentation."""

import re
from pathlib import Path

import pytest
from benchmarks.page import page_of, with_output

ROOT = Path(__file__).resolve().parents[2]


def test_only_the_place_of_the_benchmark_changes():
    text = (
        'before\n<!-- measured: a -->\nold\n<!-- end -->\n'
        'between\n<!-- measured: b -->\nkept\n<!-- end -->\n'
    )
    new = with_output(text, 'a', r'a \1 line' + '\n', 'a.py, today')
    assert new.startswith('before\n<!-- measured: a -->\n\n```\na.py, today\na \\1 line\n```\n')
    assert new.endswith('between\n<!-- measured: b -->\nkept\n<!-- end -->\n')


def test_every_place_has_a_benchmark_that_fills_it(tmp_path):
    pages = ''.join(page.read_text(encoding='utf-8') for page in (ROOT / 'docs').glob('*.md'))
    makefile = (ROOT / 'Makefile').read_text(encoding='utf-8')
    names = re.findall('<!-- measured: (.+?) -->', pages)
    assert names
    for name in names:
        assert (ROOT / f'benchmarks/{name}.py').is_file(), name
        assert f'benchmarks.page {name} ' in makefile, name
    with pytest.raises(SystemExit, match='0 pages'):
        page_of('a', tmp_path)
