"""What the documentation names is there."""

import re
import shlex
import sys
from pathlib import Path
from xml.etree import ElementTree

import click
import pytest

ROOT = Path(__file__).resolve().parent.parent
SHARE = ROOT / 'ros2_ws/src/paint_deposition'
PACKAGE = SHARE / 'paint_deposition'
PAGES = sorted([*ROOT.glob('*.md'), *(ROOT / 'docs').glob('*.md')])
every_page = pytest.mark.parametrize('page', PAGES, ids=lambda page: page.stem)


def test_the_keys_of_files_are_as_the_code_has_them(monkeypatch):
    """`make docs` writes them anew."""
    monkeypatch.syspath_prepend(str(ROOT / 'docs/site'))
    from generated import files

    page = (ROOT / 'docs/files.md').read_text(encoding='utf-8')
    assert files.written(page) == page


@every_page
def test_links_files_and_targets_of_make_that_a_page_names_are_there(page: Path):
    text, broken = page.read_text(encoding='utf-8'), []
    for target in re.findall(r'\]\((?!https?:)([^)\s]*)\)', text):
        # A badge leads to the runs of a workflow.
        target = re.sub(r'^\.\./\.\./actions/workflows/([^/]*).*', r'.github/workflows/\1', target)
        name, _, heading = target.partition('#')
        linked = page.parent / name if name else page
        if not linked.exists() or (heading and heading not in headings(linked)):
            broken.append(target)
    assert not broken
    folders = [folder for folder in (PACKAGE, SHARE, ROOT) if folder.is_dir()]
    known = {entry.name for folder in folders for entry in folder.iterdir() if entry.is_dir()}
    known -= {'build', 'install', 'runs', 'results'}
    text = re.sub(r'```.*?```', '', text, flags=re.DOTALL)
    named = [
        path for path in re.findall(r'`([\w.-]+/[\w./-]*)`', text) if path.split('/')[0] in known
    ]
    assert not [p for p in named if not any((folder / p).exists() for folder in folders)]
    targets = re.findall(r'^([a-z-]+):', (ROOT / 'Makefile').read_text(), re.MULTILINE)
    assert not set(re.findall(r'`make ([a-z-]+)', text)) - set(targets)


@every_page
def test_commands_that_are_shown_have_their_options(page: Path):
    from paint_deposition.cli.main import COMMANDS, paint

    context = click.Context(paint)
    unknown = []
    blocks = re.findall(r'```bash\n(.*?)```', page.read_text(encoding='utf-8'), re.DOTALL)
    lines = '\n'.join(blocks).replace('\\\n', ' ')
    for line in re.findall(r'^(?:\./)?paint (.*)$', lines, re.MULTILINE):
        name, *words = shlex.split(line.replace('…', ''), comments=True)
        if name not in COMMANDS:
            unknown.append(name)
            continue
        command = paint.get_command(context, name)
        options = {o for p in command.params for o in (*p.opts, *p.secondary_opts)}
        given = [word for word in words if re.fullmatch(r'--?[a-z][a-z-]*', word)]
        unknown += [f'{name} {word}' for word in given if word not in {*options, '--help'}]
    assert not unknown


@pytest.mark.skipif(sys.version_info < (3, 11), reason='tomllib comes with Python 3.11')
def test_picture_and_table_show_the_rooms_that_the_linter_holds():
    import tomllib

    settings = tomllib.loads((ROOT / 'pyproject.toml').read_text(encoding='utf-8'))
    contracts = settings['tool']['importlinter']['contracts']
    held = next(contract['layers'] for contract in contracts if contract.get('exhaustive'))
    picture = ElementTree.parse(ROOT / 'docs/images/architecture.svg')
    (drawn,) = picture.iterfind('.//*[@id="layers"]')
    shown = [text.text for text in drawn if text.get('class') == 'room']
    layers = [layer.split(' | ') for layer in held]
    assert shown == [' '.join(layer) for layer in layers], 'run docs/draw_images.py layers'
    page = (ROOT / 'docs/architecture.md').read_text(encoding='utf-8')
    rooms = [room for layer in layers for room in layer if (PACKAGE / room).is_dir()]
    assert not [room for room in rooms if f'`{room}/`' not in page]


def headings(page: Path) -> set[str]:
    """Anchors of a page as GitHub makes them."""
    lines = re.findall(r'^#+ (.*)$', page.read_text(encoding='utf-8'), re.MULTILINE)
    return {re.sub(r'[^\w\- ]', '', line.lower()).replace(' ', '-') for line in lines}
