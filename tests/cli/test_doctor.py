"""`paint doctor`: what is there, and a self-test that can fail."""

import json
import subprocess
from importlib import metadata

import pytest
import rclpy

from cli.command import paint
from paint_deposition.cli import results, samples


def findings(code: int) -> dict[str, dict]:
    done = paint('doctor', '--json')
    assert (done.returncode, done.stderr) == (code, '')
    told = json.loads(done.stdout)
    assert told['well'] == (done.returncode == 0)
    return {one['name']: one for one in told['findings']}


@pytest.mark.slow
def test_a_complete_installation_is_well():
    found = findings(0)
    assert f'numpy {metadata.version("numpy")}' in found['libraries']['found'].split(', ')
    assert rclpy.get_rmw_implementation_identifier() in found['ROS 2']['found']
    for name in ('libraries', 'known film', 'live = offline'):
        assert found[name]['ok'] is True
    assert not [one for one in found.values() if one['remedy'] and one['ok'] is not None]


@pytest.mark.slow
def test_a_film_that_is_not_the_known_one_is_an_error(monkeypatch):
    monkeypatch.setattr(samples, 'KNOWN_FILM_UM', samples.KNOWN_FILM_UM * (1 + 2e-4))
    found = findings(1)
    assert [one['name'] for one in found.values() if one['ok'] is False] == ['known film']
    assert found['known film']['remedy']


def test_a_library_that_is_missing_or_too_old_is_an_error_unless_an_extra_wants_it(monkeypatch):
    wanted = ['click>=99', 'nowhere>=3', 'numpy', 'elsewhere>=2; extra == "many"']
    monkeypatch.setattr(metadata, 'requires', lambda package: wanted)
    monkeypatch.setattr(samples, '_known_film', lambda: iter(()))
    found = findings(1)
    assert found['libraries']['remedy'] == "pip install 'click>=99' 'nowhere>=3'"
    many, remedy = found['extra many'], "pip install 'elsewhere>=2'"
    assert (many['found'], many['ok'], many['remedy']) == ('elsewhere missing', None, remedy)


def test_what_cannot_be_looked_at_is_an_error_with_a_remedy(monkeypatch):
    def broken():
        raise RuntimeError("cannot cache function '_fill': no locator available")

    monkeypatch.setattr(samples, '_known_film', broken)
    done = paint('doctor')
    assert done.returncode == 1
    assert 'BAD broken' in done.stdout
    assert '-> set NUMBA_CACHE_DIR to a folder that can be written' in done.stdout
    assert done.stdout.endswith('paint does not work as it should\n')


def test_no_other_python_takes_a_module_from_the_current_folder(tmp_path, monkeypatch):
    """Those of `doctor` and of `watch --live`: they start from the same list of words."""
    for name in ('numpy', 'rclpy', 'mine'):
        (tmp_path / f'{name}.py').write_text('open("ran", "w")')
    monkeypatch.chdir(tmp_path)
    found = {one.name: one for one in samples._ros()}
    assert rclpy.get_rmw_implementation_identifier() in found['ROS 2'].found
    command = results.python('import numpy; print(numpy.array(sys.argv[1:]))\nimport mine', 'a')
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.stdout == "['a']\n"
    assert "No module named 'mine'" in done.stderr
    assert not (tmp_path / 'ran').exists()
