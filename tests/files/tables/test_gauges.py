"""One file of each layout that gauges write, read without a word about it.

Each holds 21.5, 22.5, 24 and 19.5 um at the points P1 to P4 of a list, in that order, unless it
says otherwise. The layouts of the makers follow their manuals.
"""

import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest

from paint_deposition.errors import ReadingsError
from paint_deposition.files.gauge_readings import read_readings
from paint_deposition.files.tables.gauge_formats import FOLDERS, FORMATS, LINES
from paint_deposition.files.tables.reading_columns import Layout
from workbook import write_workbook

LAYOUTS = Path(__file__).with_name('layouts')
FILMS_UM = [21.5, 22.5, 24.0, 19.5]
MERGED = [
    ['Messpunkt', 'Koordinaten [mm]', None, None, 'Schichtdicke [µm]', None],
    [None, 'X', 'Y', 'Z', 'Ist', 'Soll'],
    ['P1', 100, 0, 0, 21.5, 45], ['P2', 200, 0, 0, 22.5, 45],
]  # fmt: skip

# The file, and the films and the points of its rows where they are not those four in order.
CASES: dict[str, tuple[str, ...]] = {
    'coatmaster Flex, CSV or JSON': ('coatmaster.csv', '21.5 22.5 19.5', 'P1 P2 P4'),
    'coatmaster Flex, JSON': ('coatmaster.json', '21.5 22.5 19.5', 'P1 P2 P4'),
    'BYK auto-chart': ('byk.csv',),
    'DeFelsko PosiTector, Value': ('positector_value.csv',),
    'DeFelsko PosiTector, Thickness': ('positector_thickness.csv',),
    'PosiTector batch, folder': ('B1',),
    'PosiTector batch, zip': ('B1.zip',),
    'PosiTector, serial': ('serial.txt',),
    'PosiTector, serial with a missing one': ('serial_missing.txt', '21.5 19.5', 'P1 P4'),
    'Fischer, printed': ('printed.txt',),
    'spots of SSPC-PA 2': ('spots.csv', '21 22 21.5 22.5 22.5', 'P1 P1 P1 P2 P2'),
    'German statistics': ('german.csv',),
    'Japanese': ('japanese.csv', '21.5 21.7 22.5 22.3', 'P1 P1 P2 P2'),
    'two rows of headings': ('merged.xlsx', '21.5 22.5', 'P1 P2'),
    'repeats in a cell': ('repeats.csv', '21.5 22.1 21 22.5', 'P1 P1 P1 P2'),
}


@pytest.fixture
def points(tmp_path):
    """A list of the four points."""
    path = tmp_path / 'points.csv'
    path.write_text('point,x_m,y_m,z_m\n' + ''.join(f'P{k},0.{k},0,0\n' for k in range(1, 5)))
    return path


@pytest.mark.parametrize('name', CASES)
def test_a_layout_is_read_as_it_is_written(name, tmp_path, points):
    name, *expected = CASES[name]
    films, labels = expected or (' '.join(map(str, FILMS_UM)), 'P1 P2 P3 P4')
    path = LAYOUTS / name
    if name == 'B1.zip':
        path = shutil.make_archive(tmp_path / 'B1', 'zip', LAYOUTS, 'B1')
    elif name == 'merged.xlsx':
        path, points = write_workbook(tmp_path / name, {'Messung': MERGED}), None
    readings = read_readings(path, points)
    assert readings.thickness_um == pytest.approx([*map(float, films.split())], abs=2e-3)
    assert readings.point.tolist() == labels.split()
    x_m = [int(label[1]) / 10 for label in labels.split()]
    assert readings.positions_m[:, 0] == pytest.approx(np.array(x_m))


def test_each_known_layout_has_its_case():
    layouts = {*(one.name for one in FORMATS), *LINES, *FOLDERS} - {'coordinate measuring machine'}
    assert not [name for name in layouts if not any(case.startswith(name) for case in CASES)]


def test_what_the_gauge_marks_as_failed_is_counted(points):
    readings = read_readings(LAYOUTS / 'coatmaster.csv', points)
    assert '1 row without a reading, 1 of them failed by error' in readings.understood


def test_the_last_columns_of_a_measuring_machine_are_the_normal():
    readings = read_readings(LAYOUTS / 'measuring_machine.csv')
    assert readings.normals.tolist() == [[0, -1, 0]] * 2
    assert readings.thickness_um.tolist() == [21.5, 22.5]


@pytest.mark.parametrize(
    ('headings', 'layout', 'layers', 'films'),
    [
        ('Spot;E-coat;Base coat;Clearcoat;Total', {}, 'e-coat base clear total', '20 15 40 75'),
        ('Punkt;Schicht 1;Schicht 2;Schicht 3;Gesamt', {}, 'layer1 layer2 layer3 total',
         '20 15 40 75'),
        ('Point;a;b;c;d', {'layers': {'mica': 'b', 'clear': 4}}, 'mica clear', '15 40'),
    ],
)  # fmt: skip
def test_columns_may_be_layers(headings, layout, layers, films, file, points):
    path = file('f.csv', f'{headings}\nP1;20;15;40;75\nP2;;16;;\n')
    readings = read_readings(path, points, Layout(columns=layout))
    count = len(films.split())
    assert readings.layer.tolist()[:count] == layers.split()
    assert readings.thickness_um.tolist() == [*map(float, films.split()), 16]
    assert readings.point.tolist() == ['P1'] * count + ['P2']


def test_columns_of_repeats_and_a_layer_that_is_none_can_be_named(file, points):
    path = file('f.csv', 'Point;Layer;left;right\nP1;A7;20;21\nP2;B9;22;23\n')
    layout = Layout(columns={'thickness': ['left', 'right'], 'layer': 'none'})
    readings = read_readings(path, points, layout)
    assert readings.thickness_um.tolist() == [20, 21, 22, 23]
    assert set(readings.layer.tolist()) == {''}


def test_an_empty_cell_of_a_numbered_column_keeps_its_row(file, points):
    path = file('f.csv', '21,5;A\n22,5;A\n;A\n19,5;A\n')
    readings = read_readings(path, points, Layout(columns={'thickness': 1}))
    assert readings.point.tolist() == ['P1', 'P2', 'P4']


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        (
            (LAYOUTS / 'byk.csv').read_text() + 'C;1;90;20\n',
            "'No.' counts anew in each Checkzone; give a column 'point'",
        ),
        ('No.;DFT\n1;20\n2;21\n1;22\n2;21\n3;20\n', "'No.' counts anew; give a column 'point'"),
        ('Reading;Thickness\n21,5;0,8\n22,5;0,8\n', "'Reading' counts the readings of a DeFelsko"),
    ],
)
def test_a_count_names_no_point(text, message, file, points):
    with pytest.raises(ReadingsError, match=message):
        read_readings(file('f.csv', text), points)


@pytest.mark.parametrize(
    ('text', 'labels'),
    [
        # Points in any order, some of them again.
        ('no;DFT\n3;20\n1;21\n2;22\n', '3 1 2'),
        ('no;DFT\n3;20\n1;21\n3;22\n1;20\n', '3 1 3 1'),
        ('no;DFT\n1;20\n1;21\n2;22\n2;20\n', '1 1 2 2'),
        # A zone whose first reading is missing.
        ('Zone;no;DFT\nA;1;20\nA;2;21\nB;1;n/a\nB;2;22\n', '1 2 4'),
    ],
)
def test_numbers_of_points_are_no_count(text, labels, file, points):
    listed = points.with_name('numbers.csv')
    listed.write_text(points.read_text().replace('P', ''))
    assert read_readings(file('f.csv', text), listed).point.tolist() == labels.split()


def test_one_wrong_label_is_not_the_name_of_the_part(file, points):
    with pytest.raises(ReadingsError, match="the readings are called 'P9' to 'P9', and there is"):
        read_readings(file('f.csv', 'point;DFT\n' + 'P9;20\n' * 4), points)


def test_rounds_over_all_points_are_repeats(file, points):
    text = 'Round;No.;DFT\n' + ''.join(f'{r};{k};2{r}\n' for r in (1, 2) for k in range(1, 5))
    listed = points.with_name('numbers.csv')
    listed.write_text(points.read_text().replace('P', ''))
    assert read_readings(file('f.csv', text), listed).point.tolist() == [*'12341234']


def test_a_template_of_which_little_was_measured_is_warned_of(file, points):
    (doubt,) = read_readings(file('f.csv', 'Point;DFT\nP1;20\nP1;21\n'), points).doubts
    assert doubt.startswith('only 1 of the 4 points in points.csv have a reading; see whether')


def test_a_folder_with_several_tables_is_refused(tmp_path):
    for name in 'ab':
        (tmp_path / f'{name}.csv').write_text('DFT\n1\n')
    message = rf'{tmp_path.name} holds a\.csv, b\.csv; name the one with the tab'
    with pytest.raises(ReadingsError, match=message):
        read_readings(tmp_path)


# What else shops have: each is read as these readings, or refused with the reason.
PLACED = 'Punkt;X [mm];Y [mm];Z [mm];Dicke [µm]\nA1;100,0;0;50;21,5\nA2;100,0;0;200;22,1\n'
SHEET = ['Messpunkt', 'X [mm]', 'Y [mm]', 'Z [mm]', 'Dicke [µm]']
IN_CELLS = {
    'units below, a title above': [
        ['Schichtdicke Tür'], ['Messpunkt', 'X', 'Y', 'Z', 'Dicke'],
        [None, 'mm', 'mm', 'mm', 'µm'],
        ['A1', 100, 0, 50, 21.5], ['A2', 100, 0, 200, '22,1'],
    ],
    'statistics without labels': [
        SHEET, ['A1', 100, 0, 50, 21.5], ['A2', 100, 0, 200, 22.1], [], [None] * 4 + [21.8],
    ],
}  # fmt: skip
REFUSED_CELLS = {
    'stands over several columns or is a title': [[*SHEET, None], ['A1', 100, 0, 50, 21.5, 22]],
    "'12.5' beside it in line 3 has no heading": [
        ['Dicke', None, None], ['Ort', 'Basis', 'Klar'], ['A1', 12.5, 21.5],
    ],
    "sheet 'S', row 3: Dicke .* is '#DIV/0!'; expected .* or n/a where": [
        SHEET, ['A1', 100, 0, 50, 21.5], ['A2', 100, 0, 200, '#DIV/0!'],
    ],
    "sheet 'S', row 3: X .* is ''": [SHEET, ['A1', 100, 0, 50, 21.5], [None] * 4 + [21.5]],
}  # fmt: skip


@pytest.mark.parametrize(
    ('text', 'encoding'),
    [
        (PLACED, 'utf-8-sig'), (PLACED, 'utf-16'), (PLACED, 'latin-1'),
        ('sep=;\n' + PLACED, 'utf-8'),
        (PLACED.replace('\n', '\r'), 'utf-8'),
        (PLACED.replace(' [mm]', '').replace(' [µm]', '').replace('\n', '\n;mm;mm;mm;mil\n', 1)
         .replace('21,5', '0,84646').replace('22,1', '0,87008'), 'utf-8'),
        (PLACED.replace(' [µm]', '').replace('\n', '\n-;mm;mm;mm;Mikrometer\n', 1), 'utf-8'),
    ],
)  # fmt: skip
def test_encodings_and_units_below_headings(file, text, encoding):
    require_two(read_readings(file('a.csv', text, encoding)))


def require_two(readings):
    assert readings.thickness_um == pytest.approx([21.5, 22.1], abs=1e-3)
    assert readings.positions_m.tolist() == [[0.1, 0.0, 0.05], [0.1, 0.0, 0.2]]
    assert readings.point.tolist() == ['A1', 'A2']


@pytest.mark.parametrize('rows', IN_CELLS.values(), ids=IN_CELLS)
def test_what_stands_around_a_table_of_a_workbook(tmp_path, rows):
    require_two(read_readings(write_workbook(tmp_path / 'a.xlsx', {'S': rows})))


@pytest.mark.parametrize('message', REFUSED_CELLS)
def test_cells_that_could_mislead_are_refused(tmp_path, message):
    path = write_workbook(tmp_path / 'a.xlsx', {'S': REFUSED_CELLS[message]})
    with pytest.raises(ReadingsError, match=message):
        read_readings(path)


def test_files_of_one_name_in_a_zip_are_not_taken_for_each_other(tmp_path):
    path = tmp_path / 'two.zip'
    with zipfile.ZipFile(path, 'w') as package:
        for folder in ('monday', 'tuesday'):
            package.writestr(f'{folder}/door.csv', 'x_m,y_m,z_m,thickness_um\n0,0,0,20\n')
    with pytest.raises(ReadingsError, match=r'holds monday/door\.csv, tuesday/door\.csv;'):
        read_readings(path)
