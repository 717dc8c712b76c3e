"""The public interface: names that load when used, results that show and tell themselves."""

import json
import re
import subprocess
import sys
from functools import partial

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure

import paint_deposition as pd
from booth import SAMPLES
from paint_deposition.files.atomic import json_text

matplotlib.use('Agg')


@pytest.fixture(scope='module')
def film():
    panel = pd.read_mesh(SAMPLES / 'panel.stl', max_edge_length_m=0.05)
    recording = pd.read_recording(SAMPLES / 'panel_577', state_topic='/atomizer/state')
    readings = pd.read_readings(SAMPLES / 'panel_study/panel_577.csv')
    return pd.simulate(panel, recording, readings=readings)


@pytest.fixture(scope='module')
def comparison():
    campaign = pd.read_campaign(SAMPLES / 'measured_door/unseen.yaml')
    return pd.compare(campaign, pd.DepositionModel())


@pytest.fixture(scope='module')
def recommendation():
    return pd.recommend(speed_m_per_s=0.3, tolerance=0.1)


def test_every_name_is_there():
    assert {'simulate', 'Film', 'diagnose', 'write', '__version__'} < set(dir(pd))
    for name in dir(pd):
        assert getattr(pd, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        _ = pd.simulat


def test_the_import_loads_nothing_else():
    program = (
        'import sys, paint_deposition as pd\n'
        'slow = {"numpy", "numba", "scipy", "matplotlib", "pydantic", "rclpy"}\n'
        'print(sorted(slow & set(sys.modules)), pd.__version__)\n'
    )
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True)
    assert done.stdout == f'[] {pd.__version__}\n', done.stderr


@pytest.mark.slow
@pytest.mark.parametrize('name', ['film', 'comparison', 'recommendation'])
def test_results_show_and_tell_themselves(name, request, tmp_path, undrawn):
    result = request.getfixturevalue(name)
    assert repr(result).startswith(f'{type(result).__name__}(')
    assert len(repr(result)) < 200
    assert '\n' not in repr(result)
    figures = json.loads(json_text(result.to_dict()))
    assert figures
    axes = Figure().subplots()
    assert pd.plot(result, ax=axes) is axes
    assert axes.has_data()
    files = pd.write(result, tmp_path)
    assert all(file.stat().st_size for file in files)
    written = next(file for file in files if file.suffix == '.json')
    told = json.loads(written.read_text())
    assert told.pop('provenance')['package_version'] == pd.__version__
    assert told == figures


@pytest.mark.parametrize('take', [pd.plot, pd.write])
def test_what_is_no_result_is_refused(take, tmp_path):
    with pytest.raises(TypeError, match='str is not a result'):
        take('film', tmp_path)


@pytest.mark.parametrize('which', ['film', 'comparison'])
def test_a_result_is_a_table(which, request, tmp_path):
    """With the columns of its file."""
    result = request.getfixturevalue(which)
    pd.write(result, tmp_path)
    name = {'film': 'film.csv', 'comparison': 'residuals.csv'}[which]
    written = np.genfromtxt(tmp_path / name, delimiter=',', names=True, dtype=None, encoding=None)
    columns = result.columns()
    assert tuple(columns) == written.dtype.names
    for key in ('x_m', 'thickness_um'):
        assert np.allclose(written[key], columns[key], rtol=1e-4, atol=1e-3), key


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_the_code_of_the_page_runs(repository, tmp_path, monkeypatch, undrawn):
    """Of docs/python.md."""
    monkeypatch.chdir(tmp_path)
    # The sample is diagnosed where the command is tried out.
    added = partial(pd.refit, added='incidence_attraction')
    monkeypatch.setattr(pd, 'diagnose', added, raising=False)
    coarse = partial(lambda read, path, **_: read(path, max_edge_length_m=0.06), pd.read_mesh)
    monkeypatch.setattr(pd, 'read_mesh', coarse, raising=False)
    page = (repository / 'docs' / 'python.md').read_text()
    names = {}
    exec('\n'.join(re.findall(r'```python\n(.*?)```', page, re.DOTALL)), names)
    assert isinstance(names['film'], pd.Film)
    assert names['diagnosis'].accepted == ('incidence_attraction',)
    assert names['diagnosis'].columns()['best'] == ['incidence_attraction']
    assert (tmp_path / 'results/diagnosis/report.html').is_file()
