"""What commands print as JSON; `cli.command` holds every output against `cli/outputs.py`."""

import pytest

from booth import SAMPLES
from cli.command import figures_of
from paint_deposition.files.provenance import sha256

BAG = SAMPLES / 'door_horizontal'


def test_provenance_names_each_file_with_its_digest():
    told = figures_of('inspect', BAG, '--json')
    (file,) = told['provenance']['files']
    assert file == {'what': 'recording', 'file': str(BAG), 'sha256': sha256(BAG)}


def test_a_digest_changes_with_content_and_with_names(tmp_path):
    (tmp_path / 'a').write_text('film')
    first = sha256(tmp_path)
    (tmp_path / 'a').rename(tmp_path / 'b')
    renamed = sha256(tmp_path)
    (tmp_path / 'b').write_text('films')
    assert len({first, renamed, sha256(tmp_path)}) == 3


@pytest.mark.slow
def test_models_side_by_side_each_given_once(tmp_path, repository):
    start, other = repository / 'config/model.yaml', tmp_path / 'other.yaml'
    other.write_text(start.read_text().replace('K1_cm3_per_s: 1.9', 'K1_cm3_per_s: 2.4'))
    told = figures_of(
        'compare', SAMPLES / 'measured_door/unseen.yaml', '--model', start, '--model', other,
        '--json', '-o', tmp_path / 'out',
    )  # fmt: skip
    errors = {one['name']: one['rmse_um'] for one in told['models']}
    assert list(errors) == ['model', 'other']
    assert told['best'] == min(errors, key=errors.get)
    assert told['provenance']['models']['other']['planar']['K1_cm3_per_s'] == 2.4
    page = (tmp_path / 'out/report.html').read_text(encoding='utf-8')
    assert f'{told["best"]} has the smallest error' in page
    assert (tmp_path / 'out/residuals_other.csv').is_file()
