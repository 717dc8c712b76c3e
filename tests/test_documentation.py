"""Documentation names files and shows layers that are there."""

import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / 'ros2_ws/src/paint_deposition/paint_deposition'
PAGES = sorted([*ROOT.glob('*.md'), *(ROOT / 'docs').glob('*.md')])


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.stem)
def test_links_lead_to_files_and_headings(page: Path):
    for target in re.findall(r'\]\((?!https?:)([^)\s]*)\)', page.read_text(encoding='utf-8')):
        name, _, heading = target.partition('#')
        linked = page.parent / name if name else page
        assert linked.exists(), target
        assert not heading or heading in headings(linked), target


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.stem)
def test_modules_that_are_named_are_there(page: Path):
    rooms = '|'.join(room.name for room in PACKAGE.iterdir() if room.is_dir())
    text = page.read_text(encoding='utf-8')
    for module in re.findall(rf'`((?:{rooms})/[\w/]+\.py)`', text):
        assert (PACKAGE / module).is_file(), module
    for test in re.findall(r'`(tests/[\w/.]+)`', text):
        assert (ROOT / test).exists(), test


@pytest.mark.skipif(sys.version_info < (3, 11), reason='tomllib comes with Python 3.11')
def test_the_picture_shows_the_layers_that_the_linter_holds():
    import tomllib

    settings = tomllib.loads((ROOT / 'pyproject.toml').read_text(encoding='utf-8'))
    contracts = settings['tool']['importlinter']['contracts']
    held = next(contract['layers'] for contract in contracts if contract.get('exhaustive'))
    picture = ElementTree.parse(ROOT / 'docs/images/architecture.svg')
    (drawn,) = picture.iterfind('.//*[@id="layers"]')
    shown = [text.text for text in drawn if text.get('class') == 'room']
    assert shown == [' '.join(layer.split(' | ')) for layer in held]


def headings(page: Path) -> set[str]:
    """Anchors of a page as GitHub makes them."""
    lines = re.findall(r'^#+ (.*)$', page.read_text(encoding='utf-8'), re.MULTILINE)
    return {re.sub(r'[^\w\- ]', '', line.lower()).replace(' ', '-') for line in lines}
