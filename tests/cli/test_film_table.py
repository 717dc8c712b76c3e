"""`paint simulate --parquet`: the film at the vertices to the last bit, there and back."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from cli.command import COARSE, assert_refused, paint
from paint_deposition.errors import ReadingsError
from paint_deposition.files.gauge_readings import read_readings

NAMES = ['x_m', 'y_m', 'z_m', 'thickness_um', 'nx', 'ny', 'nz', 'area_m2']


@pytest.fixture(scope='module')
def simulate(panel, one_pass):
    """The command on one pass over the panel, writing to the folder named."""

    def run(folder, *more):
        inputs = ('--mesh', panel, '--trajectory', one_pass)
        return paint('simulate', *inputs, *COARSE, '-o', folder, *more)

    return run


@pytest.fixture(scope='module')
def painted(simulate, tmp_path_factory):
    folder = tmp_path_factory.mktemp('painted')
    done = simulate(folder, '--parquet')
    assert done.returncode == 0, done.stderr
    assert str(folder / 'film.parquet') in done.stdout
    return folder


def test_the_table_holds_all_paint_on_the_part(painted):
    """Film times area is the paint laid, 1 um m2 = 1 cm3, with no rounding between."""
    table = pq.read_table(painted / 'film.parquet')
    assert table.column_names == NAMES
    assert set(table.schema.types) == {pa.float64()}
    column = {name: table[name].to_numpy() for name in NAMES}
    figures = json.loads((painted / 'stats.json').read_text())
    laid_cm3 = column['thickness_um'] @ column['area_m2']
    assert laid_cm3 == pytest.approx(figures['painted_volume_cm3'], rel=1e-12)
    assert column['thickness_um'].max() == figures['max_um']
    lengths = np.sqrt(column['nx'] ** 2 + column['ny'] ** 2 + column['nz'] ** 2)
    assert lengths == pytest.approx(1.0)
    csv = np.genfromtxt(painted / 'film.csv', delimiter=',', names=True)
    for name in NAMES[:4]:
        assert csv[name] == pytest.approx(column[name], rel=1e-8)


def test_the_table_is_read_back_as_readings(simulate, painted, tmp_path):
    """A film of another model, or of another program, is compared like readings."""
    readings = read_readings(painted / 'film.parquet')
    film = pq.read_table(painted / 'film.parquet')['thickness_um'].to_numpy()
    assert np.array_equal(readings.thickness_um, film)
    done = simulate(tmp_path, '--at', painted / 'film.parquet')
    assert done.returncode == 0, done.stderr
    assert f'film.parquet: {len(film)} readings, Parquet; ' in done.stderr
    predicted = np.genfromtxt(tmp_path / 'predicted.csv', delimiter=',', names=True)
    assert np.abs(predicted['predicted_um'] - film).max() < 1e-3


def test_a_table_that_claims_too_much_is_refused_before_it_is_read(tmp_path):
    zeros = pa.array(np.zeros(5_000_001))
    path = tmp_path / 'large.parquet'
    pq.write_table(pa.table({'x_m': zeros, 'thickness_um': zeros}), path)
    assert path.stat().st_size < 100_000
    with pytest.raises(ReadingsError, match='more than 10000000 values'):
        read_readings(path)


def test_a_damaged_table_is_refused(simulate, painted, tmp_path):
    cut = tmp_path / 'cut.parquet'
    cut.write_bytes((painted / 'film.parquet').read_bytes()[:-100])
    done = simulate(tmp_path / 'out', '--at', cut)
    assert_refused(done, str(cut), 'cannot be read as Parquet')
