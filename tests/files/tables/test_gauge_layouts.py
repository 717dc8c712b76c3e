"""Tables of readings in any layout: what is read of which points, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from paint_deposition.errors import ReadingsError
from paint_deposition.files.gauge_readings import read_readings, write_predictions
from paint_deposition.files.tables.reading_columns import Layout
from paint_deposition.part.surface import Surface
from surfaces import triangulated
from workbook import write_workbook

LAYOUTS = Path(__file__).with_name('layouts')
POINTS = (LAYOUTS / 'points.csv').read_text()


def test_layers_side_by_side_are_predicted_each(file, tmp_path):
    head, rows = 'Punkt;x [m];y [m];z [m];Basislack;Klarlack', 'A,1;0;0;0;15,5;40\nB;1;0;0;;41'
    readings = read_readings(file('a.csv', f'{head}\n{rows}\n'))
    assert readings.layer.tolist() == ['base', 'clear', 'clear']
    write_predictions(tmp_path / 'predicted.csv', readings, np.array([15.0, 42.0, 43.0]))
    lines = (tmp_path / 'predicted.csv').read_text().splitlines()
    assert lines[0].endswith('Klarlack,predicted_um base,predicted_um clear')
    assert lines[1:] == ['"A,1",0,0,0,15.5,40,15.0000,42.0000', 'B,1,0,0,,41,,43.0000']


def listing(labels: str) -> str:
    """A list of these points, 0.1 m apart along x."""
    rows = (f'{label},0.{k},0,0\n' for k, label in enumerate(labels.split(), start=1))
    return 'no,x_m,y_m,z_m\n' + ''.join(rows)


IN_ORDER = listing('1 2 3 4 5 6')


@pytest.mark.parametrize(('text', 'measured'), [
    ('DFT\n20,5\nn/a\n21\n22\nOL\n23', [1, 3, 4, 6]),
    ('time,DFT\n8:00,20.5\n8:01,\n8:02,21\n8:03,22\n8:04,\n8:05,23\nend,\n', [1, 3, 4, 6]),
    ('DFT\n\n20.5\n21\n22\n\n\n\n23\n24\n25\n', [1, 2, 3, 4, 5, 6]),
    ('no,DFT\n1,20\n2,21\n4,22\n5,22\n', [1, 2, 4, 5]),
    ('no,DFT\n1,20\n2,21\n3,n/a\n4,22\n5,22\n6,---\n', [1, 2, 4, 5]),
])  # fmt: skip
@pytest.mark.parametrize('names', ['{}', 'P00{}'])
def test_a_missing_reading_keeps_its_number(file, text, measured, names):
    listed = listing(' '.join(names.format(k) for k in range(1, 7)))
    path, points = file('b.csv', text), file('points.csv', listed)
    if names != '{}' and '2,21\n4' in text:
        # A gauge's count with a gap is no order: it may have left out any point.
        with pytest.raises(ReadingsError, match=r"called '1' to '5', and .* 'P001' to 'P006'"):
            read_readings(path, points)
        return
    readings = read_readings(path, points)
    assert readings.positions_m[:, 0].tolist() == [k / 10 for k in measured]
    assert readings.point.tolist() == [names.format(k) for k in measured]


@pytest.mark.parametrize(
    'heading', ['DFT [mil]', 'Thickness mil', 'Schichtdicke (mils)', 'Schichtdicke Klarlack [mil]']
)
@pytest.mark.parametrize('mark', '.,')
def test_a_lone_heading_keeps_its_unit(file, heading, mark):
    text = f'{heading}\n0.8\n0.9\nn/a\n\n0.7\n1.1\n1.0\nStandard Deviation 0.1\n'
    readings = read_readings(file('b.txt', text.replace('.', mark)), file('p.csv', IN_ORDER))
    assert readings.thickness_um == pytest.approx(25.4 * np.array([0.8, 0.9, 0.7, 1.1, 1.0]))
    assert 'one column, UTF-8' in readings.understood
    assert 'in mil from' in readings.understood


@pytest.mark.parametrize('text', [
    'DFT\n20\n21\n',
    'DFT\n20\n\n21\n',
    'no,DFT\n1,20\n2,21\n3,22\n',
    'DFT\n' + '20\n' * 7,
    # A blank line may part two groups: which reading is missing is not known.
    'DFT\n20\n21\n\n22\n23\n24\n',
    'DFT\n20\n21\n\n22\nn/a\n23\n',
    # Neither headings again nor a remark with a number are readings.
    'DFT\n20\n21\n22\nDFT\n23\n24\n',
    'time,DFT\n8:00,20\n8:01,21\nNote 2,\n' + '8:02,22\n' * 3,
    'time,who,DFT\n8:00,M,20\n8:01,M,21\nBatch,2,\n' + '8:02,M,22\n' * 3,
    'time,DFT\n8:00,20\n8:01,21\n\n8:02,22\n8:03,23\n8:04,24\n',
])  # fmt: skip
def test_readings_in_order_are_refused_if_their_number_is_not_that_of_the_points(file, text):
    with pytest.raises(
        ReadingsError, match=r'readings in order for the 6 points .*; write n/a in'
    ):
        read_readings(file('b.csv', text), file('points.csv', IN_ORDER))


def test_blank_cells_of_a_workbook_keep_their_numbers(tmp_path, file):
    """72 readings in one column, the 6th not measured and the 34th not available."""
    films = [[20.0 + k] for k in range(1, 73)]
    films[5], films[33] = [None], ['n/a']
    path = write_workbook(tmp_path / 'door.xlsx', {'Door': [['DFT [µm]'], *films]})
    listed = 'no,x_m,y_m,z_m\n' + ''.join(f'{k},{k},0,0\n' for k in range(1, 73))
    readings = read_readings(path, file('points.csv', listed))
    assert np.array_equal(readings.thickness_um, 20.0 + readings.positions_m[:, 0])
    assert '(2 of them without a reading: 6, 34)' in readings.understood


@pytest.mark.parametrize('heading', ['Pos.', 'MP', 'Meas. point', 'Messpunkt Nr.', 'Point ID'])
def test_labels_under_other_headings_are_known(file, heading):
    path = file('b.csv', f'{heading},DFT\nA2,22\nA1,21\n')
    listed = file('points.csv', 'Messpunkt;X [mm];Y [mm];Z [mm]\nA1;1,000;0;0\nA2;2,000;0;0\n')
    with pytest.raises(ReadingsError, match='say decimal: comma'):
        read_readings(path, listed)
    readings = read_readings(path, listed, Layout(decimal=','))
    assert readings.positions_m[:, 0].tolist() == [0.002, 0.001]


@pytest.mark.parametrize(('listed', 'message'), [
    ('label,spot,x,y,z\n1,2,0,0,0\n', "in 'label', 'spot'; rename one of them in points.csv"),
    ('point,x,y\n1,0,0\n', 'no columns are known as x, y, z'),
    ('point,x,y,z\n', 'no points below the header'),
    ('A1,0,0,0\n', "begins with 'A1 0 0 0'.; put a row of headings on top$"),
])  # fmt: skip
def test_what_is_wrong_with_a_list_of_points_is_put_right_in_it(file, listed, message):
    with pytest.raises(ReadingsError, match=message):
        read_readings(file('b.csv', 'DFT\n20\n'), file('points.csv', listed))


def test_points_that_are_not_listed_are_named_all_at_once(file):
    text = 'point,DFT\nA1,20\nB7,21\nB8,22\n'
    with pytest.raises(ReadingsError, match=r"line 3: no point 'B7' in .* line 4: no point 'B8'"):
        read_readings(file('b.csv', text), file('points.csv', POINTS))
    twice = POINTS + 'A1;0,0;0,0;0,0;\n'
    with pytest.raises(ReadingsError, match="line 5: point 'A1' is elsewhere in line 2"):
        read_readings(file('b.csv', text), file('twice.csv', twice))


@pytest.mark.parametrize(('heading', 'um'), [
    ('DFT [mil]', 25.4), ('Dicke in mm', 1000.0), ('Trockenschichtdicke [um]', 1.0),
    ('DFT (thou)', 25.4), ('DFT in micrometers', 1.0), ('Dicke [Mikrometer]', 1.0),
    ('DFT (ist) [mil]', 25.4), ('Épaisseur [mil]', 25.4), ('Blechdicke;DFT [mil]', 25.4),
    ('Dry film thickness [µm]', 1.0), ('Total DFT [mil]', 25.4), ('Average DFT', 1.0),
    ('Paint thickness [µm]', 1.0), ('Sheet thickness;Clearcoat DFT [µm]', 1.0),
])  # fmt: skip
def test_headings_of_the_film_in_english_and_german(file, heading, um):
    blech = '0,8;' if ';' in heading else ''
    text = f'Punkt;x [m];y [m];z [m];{heading};Soll [µm];Std [µm]\nP;0;0;0;{blech}1,5;30;2\n'
    assert read_readings(file('a.csv', text)).thickness_um.tolist() == [1.5 * um]


@pytest.mark.parametrize('axis', ['{} (ist)', '{} [nominal]', '{}_nom', '{} (soll) [mm]'])
@pytest.mark.parametrize('cells', ['100;0;50;0,85', '100 mm;0 mm;50 mm;0,85 mil'])
def test_what_stands_beside_an_axis_or_behind_a_number(file, axis, cells):
    axes = ';'.join(map(axis.format, 'XYZ'))
    dicke = 'Dicke' if 'mil' in cells else 'Dicke [mil]'
    path = file('a.csv', f'Punkt;{axes};{dicke}\nA;{cells}\n')
    readings = read_readings(path)
    assert readings.positions_m.tolist() == [[0.1, 0.0, 0.05]]
    assert readings.thickness_um == pytest.approx([21.59])
    write_predictions(path.with_name('p.csv'), readings, np.array([20.0]))
    assert 'mil]' in path.with_name('p.csv').read_text()


def test_measured_places_count_before_nominal_ones(file):
    text = 'P;X soll;Y soll;Z soll;X ist;Y ist;Z ist;DFT\nA;1;2;3;4;5;6;20\n'
    assert read_readings(file('a.csv', text)).positions_m.tolist() == [[4.0, 5.0, 6.0]]


@pytest.mark.parametrize(('films', 'doubt'), [
    ('20.1 21.2 22.4 23.1 21.7', 'its last value, 21.7, may be the mean of the rest, and cou'),
    ('20 21 23 21.33 1.53 20 23', 'last 4 values, 21.33, 1.53, 20, 23, may be statistics of'),
    ('20.1 21.2 22.4 23.1 21.8', ''), ('20 20 20 20', ''),
])  # fmt: skip
@pytest.mark.parametrize('more', [0, 1])
def test_unlabelled_statistics_below_readings_are_warned_of(file, films, doubt, more):
    """Or named where there are more readings than points."""
    values = films.split()
    points = ''.join(f'{k},{k},0,0\n' for k in range(len(values) - more))
    paths = file('a.csv', '\n'.join(['DFT', *values])), file('p.csv', 'no,x_m,y_m,z_m\n' + points)
    if more:
        with pytest.raises(ReadingsError, match=doubt.partition(', and')[0] or 'write n/a'):
            read_readings(*paths)
    else:
        assert doubt in ''.join(read_readings(*paths).doubts)
        assert bool(doubt) == bool(read_readings(*paths).doubts)


def test_decimal_commas_cut_by_the_commas_between_columns_are_warned_of(file):
    points = file('p.csv', 'no,x_m,y_m,z_m\n1,0,0,0\n2,1,0,0\n')
    (doubt,) = read_readings(file('a.csv', 'point,DFT,Remark\n1,20,5\n2,21,0\n'), points).doubts
    assert doubt.startswith("'DFT' has whole numbers only, as has 'Remark' beside it: if decimal")
    for text in ('point,DFT,Remark\n1,20.0,5\n', 'point,DFT,Remark\n1,20,\n', 'DFT,point\n20,1\n'):
        assert read_readings(file('a.csv', text), points).doubts == ()


def test_columns_unit_and_decimals_can_be_named(file):
    path = file('a.csv', 'a;b;c;clear;base\n1,000;2;3;4,000;9\n')
    columns = {'x': 'a', 'y': 'b', 'z': 3, 'thickness': 'clear'}
    layout = Layout(columns, {'position': 0.0254, 'thickness': 25.4e-6}, decimal=',')
    readings = read_readings(path, layout=layout)
    assert readings.positions_m[0] == pytest.approx([0.0254, 0.0508, 0.0762], abs=1e-12)
    assert readings.thickness_um == pytest.approx([101.6])
    with pytest.raises(ReadingsError, match="'1,000' in line 2 may have a decimal comma or a"):
        read_readings(path, layout=Layout(columns=layout.columns, unit=layout.unit))
    with pytest.raises(ReadingsError, match=r"no column 'clea' for .*did you mean 'clear'"):
        read_readings(path, layout=Layout(columns={'thickness': 'clea'}))
    path.write_text('x [mm];y [mm];z [mm];DFT [µm]\n1.25;0;0;20,25\n')
    with pytest.raises(ReadingsError, match=r"point \('1.25' in line 2\) .*comma \('20,25' in"):
        read_readings(path)


def test_places_on_a_face_are_found_as_the_gun_sees_it(file):
    """On an upright panel whose outward side is -y, left is -x and the height is z."""
    sheet = triangulated(lambda x, z: 0.0 * x, 0.05, half_width_m=0.3, half_height_m=0.2)
    panel = Surface.from_triangles(*sheet, max_edge_length_m=0.1)
    path = file('a.csv', 'Point;from left [mm];height [mm];DFT [µm]\nA;100;50;20\nB;580;390;21\n')
    readings = read_readings(path, surface=panel)
    expected = np.array([[-0.2, 0.0, -0.15], [0.28, 0.0, 0.19]])
    assert readings.positions_m == pytest.approx(expected, abs=1e-6)
    beside = file('b.csv', 'from left [mm];height [mm];DFT [µm]\n610;50;20\n')
    with pytest.raises(ReadingsError, match=r'line 2: 0\.610 m from the left .* is no surface'):
        read_readings(beside, surface=panel)
    with pytest.raises(
        ReadingsError, match=r'are places on a face; .*name the file in a campaign'
    ):
        read_readings(path)


PLACED = 'Punkt;x [m];y [m];z [m];DFT [µm]\n'
COUNTED = 'Nr;x_mm;y_mm;z_mm;DFT\n7;100;0;50;21\n3;100;0;200;22\n'
COMPASS = ''.join(f'{label};{k};0;1;2{k}\n' for k, label in enumerate('ENWSRXV'))


@pytest.mark.parametrize(('text', 'listed', 'columns', 'labels', 'said'), [
    ('point,x_m,y_m,z_m,DFT\n#1,0,0,0,20\n# of the left door\n#2,1,0,0,21\n3,2,0,0,22\n',
     '', {}, '3', 'left out: 2 rows that begin with #'),
    # Compass points and letters are no statistics where they have a place or are listed.
    (f'{PLACED}{COMPASS}Mean;;;;23\ns;;;;2\nn;;;;7\n', '', {}, 'E N W S R X V',
     '3 rows of statistics'),
    ('point,DFT\nN,20\nS,21\nX,22\nMean,21\nn,3\n', 'N S X', {}, 'N S X', ''),
    # An empty cell of a numbered column keeps its row.
    ('21,5;A\n22,5;A\n;A\n19,5;A\n', 'P1 P2 P3 P4', {'thickness': 1}, 'P1 P2 P4', ''),
    # A number names a point: in any order, some of them again, where it counts no repeats.
    ('no;DFT\n3;20\n1;21\n2;22\n', '1 2 3 4', {}, '3 1 2', ''),
    ('no;DFT\n3;20\n1;21\n3;22\n1;20\n', '1 2 3 4', {}, '3 1 3 1', ''),
    ('no;DFT\n1;20\n1;21\n2;22\n2;20\n', '1 2 3 4', {}, '1 1 2 2', ''),
    (f'{COUNTED}7;100;0;50;23\n', '', {}, '7 3 7', ''),
    (f'{COUNTED}8;100;0;50;23\n', '', {}, 'line_2 line_3 line_2', ''),
    # A zone whose first reading is missing; rounds over all points.
    ('Zone;no;DFT\nA;1;20\nA;2;21\nB;1;n/a\nB;2;22\n', '1 2 3 4', {}, '1 2 4', ''),
    ('Round;No.;DFT\n' + ''.join(f'{r};{k};2{r}\n' for r in (1, 2) for k in (1, 2, 3, 4)),
     '1 2 3 4', {}, '1 2 3 4 1 2 3 4', ''),
])  # fmt: skip
def test_which_rows_are_readings_and_of_which_points(file, text, listed, columns, labels, said):
    points = file('p.csv', listing(listed)) if listed else None
    readings = read_readings(file('a.csv', text), points, Layout(columns=columns))
    assert readings.point.tolist() == [label.replace('_', ' ') for label in labels.split()]
    assert said in readings.understood


@pytest.mark.parametrize(('text', 'columns', 'message'), [
    ('20,5\n21,5\n', {'thickness': 1}, "'20,5' in line 1 may be two numbers or one with a"),
    ('Block;Nr;Messwert\n1;1;20\n1;2;21\n2;1;22\n', {}, "'Nr' counts anew in each Block"),
    ('#,F,N\nGauge,1,2\n', {}, "the thickness .columns: '#', 'F', 'N'"),
    ('point,DFT\n1,20\n2,<5\n', {}, "line 3: DFT is '<5'; expected .*, or n/a where there is"),
    ('point;DFT\n1;20\n;21\n2;22\n', {}, 'line 3: the point has no label'),
    ('point,DFT\n1,20\npoint,DFT,Units\n2,1,mil\n', {}, 'lines 1 and 3 are headings of two'),
    ('Punkt;Nassschichtdicke\n1;45\n', {}, "thickness .columns: 'Punkt', 'Nassschichtdicke'"),
    ('no;DFT soll;Dicke Lack\n1;2;3\n', {}, "thickness .columns: 'no', 'DFT soll', 'Dicke"),
    ('point,DFT\n1,20,5\n2,21,5\n', {}, 'with decimal commas, put semicolons between the col'),
    ('point;DFT [mm]\n1;24\n', {}, 'is 24000; .* it may be in another unit than is said'),
    ('point;DFT\n1;24 µm\n2;1 mil\n', {}, "DFT is '24 µm'; .* write the one unit in the hea"),
    ('Units;mils\n\npoint;DFT [µm]\n1;24\n', {}, 'thickness is in mil and µm; give all of'),
    ('Meas. pt,DFT\n2,22\n1,21\n3,23\n4,24\n5,25\n6,26\n', {},
     "the column 'Meas. pt' holds the labels of p.csv .* say columns: {point: Meas. pt}"),
    ('Meas. pt,X [mm],Bake history\nA,1,2\n', {}, "columns: 'Meas. pt', 'X .mm.', 'Bake hist"),
    ('a,x,y,z,DFT\n,m,m,m,ell\nP,0,0,0,1\n', {}, "thickness .*; 'DFT' is in 'ell': give it"),
    ('Point;Inner thickness;Outer thickness\nA;1;2\n', {},
     "it may be 'Inner thickness' or 'Outer thickness': name one with columns: {thick"),
])  # fmt: skip
def test_tables_without_places_that_could_mislead_are_refused(file, text, columns, message):
    with pytest.raises(ReadingsError, match=message):
        read_readings(file('a.csv', text), file('p.csv', IN_ORDER), Layout(columns=columns))


def test_the_limits_below_an_export_are_no_readings(file):
    readings = read_readings(LAYOUTS / 'elcomaster.csv', file('p.csv', listing('1 2')))
    assert readings.thickness_um == pytest.approx([21.59, 22.098])
    assert '5 rows of statistics' in readings.understood


@pytest.mark.parametrize('places', [';X [mm];Y [mm];Z [mm]', ''])
def test_points_by_row_and_column_keep_their_names(file, places):
    at = {(1, 1): ';100;0;50', (1, 2): ';200;0;50', (2, 1): ';100;0;20', (2, 2): ';200;0;20'}
    listed = ''.join(f'{row};{column}{place}\n' for (row, column), place in at.items())
    points = file('p.csv', 'Zeile;Spalte;X [mm];Y [mm];Z [mm]\n' + listed)
    rows = ''.join(f'{r};{c}{at[r, c] if places else ""};2{r},{c}\n' for r, c in list(at)[::-1])
    path = file('a.csv', f'Zeile;Spalte{places};Dicke\n{rows}', 'latin-1')
    readings = read_readings(path, None if places else points)
    assert readings.point.tolist()[1] == 'Zeile 2 Spalte 1'
    assert readings.thickness_um.tolist() == [22.2, 22.1, 21.2, 21.1]
    assert readings.positions_m[1].tolist() == [0.1, 0.0, 0.02]
    assert readings.group.tolist() == ['Spalte 2', 'Spalte 1'] * 2


@pytest.mark.parametrize('zero', ['missing', 'film', ''])
def test_what_a_zero_is_can_be_said(file, zero):
    text = 'DFT\n20,5\n0\n0,0\n22\n21\n23\n'
    readings = read_readings(file('a.csv', text), file('p.csv', IN_ORDER), Layout(zero=zero))
    assert readings.zero_is_film == (zero == 'film')
    assert readings.point.tolist() == [*'1456'] if zero == 'missing' else [*'123456']
