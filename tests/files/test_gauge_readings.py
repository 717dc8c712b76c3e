"""Tables of readings: what is read from them, and one clear line for each fault."""

import numpy as np
import pytest

from paint_deposition.errors import ReadingsError
from paint_deposition.files.gauge_readings import read_readings

HEADER = 'x_m,y_m,z_m,thickness_um'


@pytest.fixture
def table(file):
    """`table(line, ...)`: a CSV file of these lines."""
    return lambda *lines: file('door.csv', '\n'.join(lines) + '\n')


def test_every_column_arrives_where_it_belongs(table):
    path = table(
        f'point,{HEADER},operator,group,sigma_um,nx,ny,nz,session',
        'A1,0.1,0.2,0.3,21.5,Kim,left,0.8,0,-2,0,morning',
        'A2,0.4,0.5,0.6,22.5,Kim,right,,0,0,3,',
    )
    readings = read_readings(path)
    assert readings.positions_m == pytest.approx(np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]]))
    assert readings.thickness_um.tolist() == [21.5, 22.5]
    assert readings.point.tolist() == ['A1', 'A2']
    assert readings.group.tolist() == ['left', 'right']
    assert readings.session.tolist() == ['morning', '']
    assert readings.sigma_um[0] == 0.8
    assert np.isnan(readings.sigma_um[1])
    assert readings.normals.tolist() == [[0, -1, 0], [0, 0, 1]]
    assert readings.source == str(path)


def test_without_labels_readings_at_exactly_one_place_are_repeats(table):
    readings = read_readings(table(f'{HEADER},point', '0,0,0,20,', '0,0,0.01,21,', '1,0,0,9,A'))
    assert len(set(readings.point)) == 3
    readings = read_readings(table(HEADER, '0,0,0,20', '1,0,0,30', '0,0,0,21', '0,0,1e-4,22'))
    first, second, third, fourth = readings.point
    assert first == third
    assert len({first, second, fourth}) == 3


@pytest.mark.parametrize(
    ('lines', 'message'),
    [
        (
            ['x_m,y_m,thickness_um', '0,0,20'],
            r"known as z \(columns: 'x_m', 'y_m', 'thickness_um'\); give it with columns: {z: ",
        ),
        (['x_mm,y_m,z_m,thickness_um', '0,0,0,20'], 'x, y, z are in .* give all in one of m, mm'),
        (['x,y,z,DFT', 'ell,ell,ell,um', '0,0,0,20'], "x, y, z are in 'ell'; give all in one"),
        (['x_m,y_m,z_m,thickness_m', '0,0,0,1'], 'no column is known as the thick'),
        (['x,y,z,dft_um,film_um', '0,0,0,1,2'], "may be in 'dft_um', 'film_um'; name one"),
        (
            ['x,y,z,base_um', '0,0,0,1'],
            r"'base_um'\); call it thickness_um, DFT, film thickness or",
        ),
        (['point,thickness_um', 'A,20'], 'no coordinates .* a list of measuring points'),
        ([], 'there is nothing to read in it'),
        ([HEADER, '0,0,0'], 'line 2: 3 values under 4 column names'),
        ([HEADER, '0,0,0,20', '', '0,0,1,20,5'], 'line 4: 5 values under 4 column names'),
        ([HEADER, '0,0,0,'], 'no readings below the header'),
        ([HEADER], 'no readings below the header'),
        ([HEADER, '0,0 um,0,20'], "line 2: y_m is '0 um'; expected a number with a decimal point"),
        ([HEADER, '0,nan,0,20'], 'line 2: y_m is nan; expected a finite number'),
        ([HEADER, '0,0,0,-9'], 'line 2: thickness_um is -9; expected -5 to 5000 micrometres'),
        ([f'{HEADER},x_m', '0,0,0,20,0'], "two columns are called 'x_m'"),
        ([f'{HEADER},sigma_um', '0,0,0,20,0'], 'line 2: sigma_um is 0; expected above 0'),
        ([f'{HEADER},nx,ny', '0,0,0,20,0,1'], 'has nx, ny only; give all of nx,ny,nz or none'),
        ([f'{HEADER},nx,ny,nz', '0,0,0,20,0,0,0'], 'line 2: the normal nx,ny,nz has length zero'),
        (
            [f'{HEADER},point', '0,0,0,20,A', '0.2,0,0,20,A'],
            "point 'A' is used 0.200 m apart; give each place a label of its own",
        ),
    ],
)
def test_a_fault_is_refused_in_one_line(table, lines, message):
    path = table(*lines)
    with pytest.raises(ReadingsError, match=message) as refused:
        read_readings(path)
    assert str(refused.value).startswith(str(path))
    assert '\n' not in str(refused.value)


def test_all_faults_of_a_file_are_named_at_once(table):
    path = table(HEADER, '0,a,0,20', '0,0,0,21', '0,0,0,9999', '0,0', '0,0,0,20', 'b,0,0,20')
    with pytest.raises(ReadingsError) as refused:
        read_readings(path)
    text = str(refused.value)
    assert '4 errors: line 2: y_m' in text
    assert all(f'; line {line}: ' in text for line in (4, 5, 7))
    assert '\n' not in text


def test_a_file_that_is_no_table_is_refused(tmp_path):
    with pytest.raises(ReadingsError, match='no such file; give a table as CSV'):
        read_readings(tmp_path / 'none.csv')
    path = tmp_path / 'file'
    for content, kind in ((b'x_m,\xff\xfe\x00', 'text'), (b'PK\x03\x04 and none', 'a workbook')):
        path.write_bytes(content)
        with pytest.raises(ReadingsError, match=f'cannot be read as {kind}'):
            read_readings(path)
