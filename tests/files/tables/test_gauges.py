"""One file of each layout that gauges, robots and spreadsheets write, read as it is.

The layouts follow the makers' manuals: lines about the batch, a table with units in its headings
or in a column of its own, and the statistics of the batch below it.
"""

from pathlib import Path

import numpy as np
import pytest

from paint_deposition.errors import ReadingsError
from paint_deposition.files.gauge_readings import read_readings, write_predictions
from paint_deposition.files.tables.gauge_formats import FOLDERS, FORMATS, LINES
from paint_deposition.files.tables.reading_columns import Layout
from workbook import write_workbook

LAYOUTS = Path(__file__).with_name('layouts')
MERGED = [
    ['Messpunkt', 'Koordinaten [mm]', None, None, 'Schichtdicke [µm]', None],
    [None, 'X', 'Y', 'Z', 'Ist', 'Soll'],
    ['P1', 100, 0, 0, 21.5, 45], ['P2', 200, 0, 0, 22.5, 45],
]  # fmt: skip

# The file, and the films [µm] and the points of its rows where they are not those four in order.
CASES: dict[str, tuple[str, ...]] = {
    'coatmaster Flex, CSV or JSON': ('coatmaster.csv', '21.5 22.5 19.5', 'P1 P2 P4'),
    'coatmaster Flex, JSON': ('coatmaster.json', '21.5 22.5 19.5', 'P1 P2 P4'),
    'BYK auto-chart': ('byk.csv',),
    'DeFelsko PosiTector, Value': ('positector_value.csv',),
    'DeFelsko PosiTector, Thickness': ('positector_thickness.csv',),
    'PosiTector batch, folder': ('B1',),
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
def points(file):
    """A list of the four points."""
    rows = ''.join(f'P{k},0.{k},0,0\n' for k in range(1, 5))
    return file('points.csv', f'point,x_m,y_m,z_m\n{rows}')


@pytest.mark.parametrize('name', CASES)
def test_a_layout_is_read_as_it_is_written(name, tmp_path, points):
    name, *expected = CASES[name]
    films, labels = expected or ('21.5 22.5 24.0 19.5', 'P1 P2 P3 P4')
    path = LAYOUTS / name
    if name == 'merged.xlsx':
        path, points = write_workbook(tmp_path / name, {'Messung': MERGED}), None
    readings = read_readings(path, points)
    assert readings.thickness_um == pytest.approx([*map(float, films.split())], abs=2e-3)
    assert readings.point.tolist() == labels.split()
    x_m = [int(label[1]) / 10 for label in labels.split()]
    assert readings.positions_m[:, 0] == pytest.approx(np.array(x_m))


def test_each_known_layout_has_its_case():
    layouts = {*(one.name for one in FORMATS), *LINES, *FOLDERS} - {'coordinate measuring machine'}
    assert not [name for name in layouts if not any(case.startswith(name) for case in CASES)]


def test_failed_readings_are_counted_and_few_of_many_points_warned_of(points, file):
    readings = read_readings(LAYOUTS / 'coatmaster.csv', points)
    assert '1 row without a reading, 1 of them failed by error' in readings.understood
    (doubt,) = read_readings(file('f.csv', 'Point;DFT\nP1;20\nP1;21\n'), points).doubts
    assert doubt.startswith('only 1 of the 4 points in points.csv have a reading; see whether')


def test_the_last_columns_of_a_measuring_machine_are_the_normal():
    readings = read_readings(LAYOUTS / 'measuring_machine.csv')
    assert readings.normals.tolist() == [[0, -1, 0]] * 2
    assert readings.thickness_um.tolist() == [21.5, 22.5]


@pytest.mark.parametrize(('headings', 'layout', 'layers', 'films'), [
    ('Spot;E-coat;Base coat;Clearcoat;Total', {}, 'e-coat base clear total', '20 15 40 75'),
    ('Punkt;Schicht 1;Schicht 2;Schicht 3;Gesamt', {}, 'layer1 layer2 layer3 total',
     '20 15 40 75'),
    ('Point;a;b;c;d', {'layers': {'mica': 'b', 'clear': 4}}, 'mica clear', '15 40'),
])  # fmt: skip
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


@pytest.mark.parametrize(('text', 'message'), [
    (
        (LAYOUTS / 'byk.csv').read_text() + 'C;1;90;20\n',
        "'No.' counts anew in each Checkzone; give a column 'point'",
    ),
    ('No.;DFT\n1;20\n2;21\n1;22\n2;21\n3;20\n', "'No.' counts anew; give a column 'point'"),
    ('Reading;Thickness\n21,5;0,8\n22,5;0,8\n', "'Reading' counts the readings of a DeFelsko"),
    # One label throughout is that of the part, but not one that nearly is a point's.
    ('point;DFT\n' + 'P9;20\n' * 4, "the readings are called 'P9' to 'P9', and there is"),
])  # fmt: skip
def test_a_count_or_a_wrong_label_names_no_point(text, message, file, points):
    with pytest.raises(ReadingsError, match=message):
        read_readings(file('f.csv', text), points)


def test_a_folder_with_several_tables_is_refused(tmp_path):
    for name in ('monday', 'tuesday'):
        (tmp_path / f'{name}.csv').write_text('DFT\n1\n')
    with pytest.raises(ReadingsError, match=r'holds monday\.csv, tuesday\.csv; name the one with'):
        read_readings(tmp_path)


def require_the_four_readings(readings, within_um=1e-9):
    """All layouts hold the same four readings at the same three points."""
    assert readings.thickness_um == pytest.approx([21.5, 22.1, 24.0, 19.4], abs=within_um)
    assert readings.point.tolist() == ['A1', 'A1', 'A2', 'A3']
    points_m = np.array([[0.1, 0.0, 0.05], [0.1, 0.0, 0.2], [0.25, 0.0, 0.35]])
    assert readings.positions_m == pytest.approx(points_m[[0, 0, 1, 2]], abs=1e-12)


# Files in `layouts/`, and what is said of each: a unit in a column of its own and statistics
# behind their names; German Windows, with repeats side by side; the summary before the readings
# and labels of points in the notes; a robot's list aligned by blanks, nominal places and measured.
MAKERS = {
    'elcometer': "elcometer.txt: 4 readings, commas, UTF-8; x, y, z in mm, thickness in µm from "
    "'Reading'; left out: 1 row without a reading, 7 rows of statistics",
    'fischer': 'tabs, cp1252, decimal comma; x, y, z in mm, thickness in µm from',
    'positector': 'of 3 points in points.csv (semicolons, UTF-8, decimal comma), joined by '
    "'Point', thickness in mil from 'Thickness'",
    'robot': 'blanks, UTF-16; x, y, z in mm (no unit is given; the largest is 350), '
    "thickness in µm (no unit is given) from 'DFT'",
}  # fmt: skip


@pytest.mark.parametrize('maker', MAKERS)
def test_layouts_of_makers(maker):
    points = LAYOUTS / 'points.csv' if maker == 'positector' else None
    readings = read_readings(LAYOUTS / f'{maker}.txt', points)
    require_the_four_readings(readings, 2e-3 if points else 1e-9)
    assert MAKERS[maker] in readings.understood


def test_predictions_are_written_beside_the_columns_of_the_file(tmp_path):
    written, readings = tmp_path / 'predicted.csv', read_readings(LAYOUTS / 'fischer.txt')
    write_predictions(written, readings, np.array([1.0, 1.0, 2.0, 3.0]))
    lines = written.read_text().splitlines()
    assert lines[1] == 'A1,100.0,0.0,50.0,21.5,22.1,1.0000'
    assert len(lines) == 4


def test_spreadsheet(tmp_path):
    """Title rows, numbers as numbers and as text with a comma, a second sheet without readings."""
    rows = [
        ['Türaußenhaut, Los 17'], [],
        [None, 'Messpunkt', 'X [mm]', 'Y [mm]', 'Z [mm]', 'Lackschichtdicke (µm)', 'i.O.?'],
        [None, 'A1', 100, 0, 50, 21.5, 'ja'], [None, 'A1', 100, 0, 50, '22,1', 'ja'],
        [None, 'A2', 100, 0, 200, 24, 'ja'], [None, 'A3', 250, 0, 350, '19,4', 'nein'],
        [None, 'Mittelwert', None, None, None, 21.75],
    ]  # fmt: skip
    path = tmp_path / 'tuer.xlsx'
    write_workbook(path, {'Deckblatt': [['Kunde', 'Werk 3']], 'Messung': rows})
    readings = read_readings(path)
    require_the_four_readings(readings)
    assert "sheet 'Messung'" in readings.understood
    twice = tmp_path / 'twice.xlsx'
    write_workbook(twice, {'left': rows, 'right': rows})
    with pytest.raises(ReadingsError, match="tables in sheet 'left' and sheet 'right'; name one"):
        read_readings(twice)
    require_the_four_readings(read_readings(twice, layout=Layout(sheet='right')))


# What else shops have: each is read as these readings, or refused with the reason.
PLACED = 'Punkt;X [mm];Y [mm];Z [mm];Dicke [µm]\nA1;100,0;0;50;21,5\nA2;100,0;0;200;22,1\n'
SHEET = ['Messpunkt', 'X [mm]', 'Y [mm]', 'Z [mm]', 'Dicke [µm]']
FIRST, SECOND = ['A1', 100, 0, 50, 21.5], ['A2', 100, 0, 200, 22.1]
IN_CELLS = {
    'units below, a title above': [
        ['Schichtdicke Tür'], ['Messpunkt', 'X', 'Y', 'Z', 'Dicke'],
        [None, 'mm', 'mm', 'mm', 'µm'],
        FIRST, [*SECOND[:4], '22,1'],
    ],
    'statistics without labels': [SHEET, FIRST, SECOND, [], [None] * 4 + [21.8]],
}  # fmt: skip
REFUSED_CELLS = {
    'stands over several columns or is a title': [[*SHEET, None], ['A1', 100, 0, 50, 21.5, 22]],
    "'12.5' beside it in line 3 has no heading": [
        ['Dicke', None, None], ['Ort', 'Basis', 'Klar'], ['A1', 12.5, 21.5],
    ],
    "sheet 'S', row 3: Dicke .* is '#DIV/0!'; expected .* or n/a where": [
        SHEET, FIRST, [*SECOND[:4], '#DIV/0!'],
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
