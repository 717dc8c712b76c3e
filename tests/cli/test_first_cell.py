"""The guide docs/first_cell.md, command by command."""

import re
import shlex
import shutil

import pytest

from booth import SAMPLES
from cli.command import paint


@pytest.mark.slow
def test_the_guide_comes_to_a_painted_door(repository, tmp_path, undrawn):
    """Its commands but those of nodes, on a copy of the samples, print the figures it names."""
    page = (repository / 'docs/first_cell.md').read_text(encoding='utf-8')
    folder = shutil.copytree(SAMPLES, tmp_path / 'first_cell')
    blocks = re.findall(r'```bash\n(.*?)```', page, re.DOTALL)
    everything = ''
    for line in ''.join(block for block in blocks if ' &\n' not in block).splitlines():
        if line.startswith('paint '):
            done = paint(*shlex.split(line)[1:], cwd=folder)
            assert done.returncode == 0, done.stderr
            everything += done.stdout
    for printed, written in {
        'film 17.0 µm mean': '17.0 µm on average',
        '8.0 to 23.4 µm': '8.0 to 23.4 µm',
        'The readings show incidence_attraction': 'the readings show incidence_attraction',
        '7 horizontal passes at 188 mm, 0.637 m/s': 'seven passes, 188 mm apart at 0.637 m/s',
        'sigma_n 4.2 to 2.7 %': 'by 4.2 % (σ_N)',
        '99.8 % of it within 20 ± 2 µm': '99.8 % of the door is within 2 µm of its 20 µm',
    }.items():
        assert printed in everything
        assert written in ' '.join(page.split())
