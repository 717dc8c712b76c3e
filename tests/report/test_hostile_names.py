"""Names from files are shown in a report, and never run in it."""

import shutil
from html.parser import HTMLParser

import pytest
import yaml

from booth import SAMPLES
from cli.command import paint

HOSTILE = '</script><script>alert(1)</script><img src=x onerror="alert(2)">\'"'


class Elements(HTMLParser):
    """The tags of a page, and whatever would run when it is opened."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.scripts, self.handlers = 0, []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.scripts += tag == 'script'
        self.handlers += [name for name, _ in attributes if name.startswith('on')]


def report_with(name: str, folder) -> str:
    """The report of a comparison whose part, batch and points bear this name."""
    study = shutil.copytree(SAMPLES / 'panel_study', folder / 'study')
    head, *rows = (study / 'panel_577.csv').read_text().splitlines()
    columns = head.split(',')
    assert 'point' in columns
    quoted = '"' + name.replace('"', '""') + '"'
    named = []
    for number, row in enumerate(rows):
        cells = row.split(',')
        cells[columns.index('point')] = quoted[:-1] + f'{number}"'
        named.append(','.join(cells))
    (study / 'readings.csv').write_text('\n'.join([head, *named]) + '\n')
    entry = {
        'name': name, 'mesh': 'panel.stl', 'trajectory': 'panel_577',
        'state_topic': '/atomizer/state', 'measurements': 'readings.csv',
    }  # fmt: skip
    told = dict.fromkeys(('part', 'batch', 'paint', 'operator'), name)
    (study / 'campaign.yaml').write_text(yaml.safe_dump(told | {'experiments': [entry]}))
    (study / 'model.yaml').write_text('effects: []\n')
    done = paint(
        'compare', study / 'campaign.yaml', '--model', study / 'model.yaml', '-o', folder / 'out'
    )
    assert done.returncode == 0, done.stderr
    return (folder / 'out/report.html').read_text()


@pytest.mark.slow
def test_a_name_with_script_tags_is_text_in_the_report(tmp_path):
    plain = report_with('door', tmp_path / 'plain')
    hostile = report_with(HOSTILE, tmp_path / 'hostile')
    assert '&lt;script&gt;alert(1)' in hostile
    assert HOSTILE not in hostile
    expected, found = Elements(plain), Elements(hostile)
    assert found.scripts == expected.scripts
    assert found.handlers == expected.handlers
