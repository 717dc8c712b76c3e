"""One file of each layout that gauges write, read without a word about it.

Each holds 21.5, 22.5, 24 and 19.5 um at the points P1 to P4 of a list, in that order, unless it
says otherwise. The layouts of the makers follow their manuals.
"""

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest

from paint_deposition.errors import ReadingsError
from paint_deposition.files.gauge_readings import read_readings
from paint_deposition.files.tables.gauge_formats import FOLDERS, FORMATS, LINES
from paint_deposition.files.tables.reading_columns import Layout
from workbook import write_workbook

FILMS_UM = [21.5, 22.5, 24.0, 19.5]
COATMASTER = (
    'id,configId,sampleId,timeStamp,thickness,fit,fitState,snr,snrState,evaluateState,error'
)
STATES = '{},7,{},2026-03-12T08:15:0{}Z,{},0.99,{},41,OK,{},{}'
COATMASTER_ROWS = [
    STATES.format('a1', 'door', 1, 21.5, 'OK', 'OK', ''),
    STATES.format('a2', 'door', 2, 22.5, 'OK', 'OK', ''),
    STATES.format('a3', 'door', 3, 0, 'NOK', 'NOK', 'fit failed'),
    STATES.format('a4', 'door', 4, 19.5, 'OK', 'OK', ''),
]
COATMASTER_JSON = json.dumps({
    'instrument': 'Flex',
    'results': [
        dict(zip(COATMASTER.split(','), row.split(','), strict=True)) for row in COATMASTER_ROWS
    ],
})  # fmt: skip
BYK = 'Checkzone;No.;Gloss;Thickness [µm]\n' + ''.join(
    f'{zone};{number};90;{film}\n'
    for zone, number, film in zip('AABB', '1212', ('21,5', '22,5', '24', '19,5'), strict=True)
)
BATCH = {
    'header.txt': 'Name,B1\nSerial,784001\nUnits,mil\n',
    'readings.txt': 'Reading,Value\n1,0.8465\n2,0.8858\n3,0.9449\n4,0.7677\n',
    'statistics.txt': 'Set,Mean,Min,Max\n1,0.86,0.77,0.94\n',
    'B1.json': '{"readings": [{"reading": 1, "value": 0.8465}]}',
}
SPOTS = 'Spot,Gage 1,Gage 2,Gage 3,Spot Avg\nP1,21,22,21.5,21.5\nP2,22.5,22.5,,22.5\n'
MEASURED = 'X;Y;Z;I;J;K;Thickness\n100;0;0;0;-1;0;21,5\n200;0;0;0;-1;0;22,5\n'
STATISTICS = ('Durchschnitt', 'STABW', 'StdAbw', 'Streuung', 'VK', 'Cpk', 'Cp')
GERMAN = 'Messpunkt;Schichtdicke [µm]\nP1;21,5\nP2;22,5\nP3;24\nP4;19,5\n' + ''.join(
    f'{name};1,2\n' for name in STATISTICS
)
JAPANESE = '箇所名,測定値1,測定値2,平均値\nP1,21.5,21.7,21.6\nP2,22.5,22.3,22.4\n平均,22,22,22\n'
PRINTED = 'Appl.: 3\nBlock: 1\n' + ''.join(
    f'n.= {k}   {film} µm\n' for k, film in enumerate(FILMS_UM, 1)
)
SERIAL = ''.join(f'\x02   {film / 25.4:.4f} mil  N1\r\n' for film in FILMS_UM)
MERGED = [
    ['Messpunkt', 'Koordinaten [mm]', None, None, 'Schichtdicke [µm]', None],
    [None, 'X', 'Y', 'Z', 'Ist', 'Soll'],
    ['P1', 100, 0, 0, 21.5, 45], ['P2', 200, 0, 0, 22.5, 45],
]  # fmt: skip

# The file, its content, the films of each row (or FILMS_UM), and their points (or all in order).
CASES: dict[str, tuple] = {
    'coatmaster Flex, CSV or JSON': (
        'f.csv', '\n'.join([COATMASTER, *COATMASTER_ROWS]), '21.5 22.5 19.5', 'P1 P2 P4',
    ),
    'coatmaster Flex, JSON': ('f.json', COATMASTER_JSON, '21.5 22.5 19.5', 'P1 P2 P4'),
    'BYK auto-chart': ('f.csv', BYK),
    'DeFelsko PosiTector, Value': (
        'f.csv', BATCH['readings.txt'].replace('Value', 'Value (mils)'),
    ),
    'DeFelsko PosiTector, Thickness': (
        'f.csv', 'Reading,Thickness\n1,21.5\n2,22.5\n3,24\n4,19.5\n',
    ),
    'PosiTector batch, folder': ('B1', BATCH),
    'PosiTector batch, zip': ('B1.zip', BATCH),
    'PosiTector, serial': ('f.txt', SERIAL),
    'PosiTector, serial with a missing one': (
        'f.txt', '21.5um NONFE\n---\n---um NONFE\n19.5um NONFE\n', '21.5 19.5', 'P1 P4',
    ),
    'Fischer, printed': ('f.txt', PRINTED),
    'spots of SSPC-PA 2': ('f.csv', SPOTS, '21 22 21.5 22.5 22.5', 'P1 P1 P1 P2 P2'),
    'German statistics': ('f.csv', GERMAN),
    'Japanese': ('f.csv', JAPANESE.encode('cp932'), '21.5 21.7 22.5 22.3', 'P1 P1 P2 P2'),
    'two rows of headings': ('f.xlsx', MERGED, '21.5 22.5', 'P1 P2'),
    'repeats in a cell': ('f.csv', 'Punkt,Dicke\nP1,21.5; 22.1;21\nP2,22.5\n',
                          '21.5 22.1 21 22.5', 'P1 P1 P1 P2'),
}  # fmt: skip


@pytest.fixture
def written(tmp_path):
    """`written(name, content)`: a text, a workbook's rows, or the files of a folder or a zip."""

    def write(name: str, content) -> Path:
        path = tmp_path / name
        if isinstance(content, list):
            return write_workbook(path, {'Messung': content})
        if isinstance(content, str | bytes):
            path.write_bytes(content.encode() if isinstance(content, str) else content)
        elif path.suffix == '.zip':
            with zipfile.ZipFile(path, 'w') as package:
                for file, text in content.items():
                    package.writestr(f'B1/{file}', text)
        else:
            path.mkdir()
            for file, text in content.items():
                (path / file).write_text(text)
        return path

    return write


@pytest.fixture
def points(tmp_path):
    """A list of the four points."""
    path = tmp_path / 'points.csv'
    path.write_text('point,x_m,y_m,z_m\n' + ''.join(f'P{k},0.{k},0,0\n' for k in range(1, 5)))
    return path


@pytest.mark.parametrize('name', CASES)
def test_a_layout_is_read_as_it_is_written(name, written, points):
    file, content, *expected = CASES[name]
    films, labels = expected or (' '.join(map(str, FILMS_UM)), 'P1 P2 P3 P4')
    placed = name == 'two rows of headings'
    readings = read_readings(written(file, content), None if placed else points)
    assert readings.thickness_um == pytest.approx([*map(float, films.split())], abs=2e-3)
    assert readings.point.tolist() == labels.split()
    x_m = [int(label[1]) / 10 for label in labels.split()]
    assert readings.positions_m[:, 0] == pytest.approx(np.array(x_m))


def test_each_known_layout_has_its_case():
    layouts = {*(one.name for one in FORMATS), *LINES, *FOLDERS} - {'coordinate measuring machine'}
    assert not [name for name in layouts if not any(case.startswith(name) for case in CASES)]


def test_what_the_gauge_marks_as_failed_is_counted(written, points):
    readings = read_readings(written('f.csv', '\n'.join([COATMASTER, *COATMASTER_ROWS])), points)
    assert '1 row without a reading, 1 of them failed by error' in readings.understood


def test_the_last_columns_of_a_measuring_machine_are_the_normal(written):
    readings = read_readings(written('f.csv', MEASURED))
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
def test_columns_may_be_layers(headings, layout, layers, films, written, points):
    path = written('f.csv', f'{headings}\nP1;20;15;40;75\nP2;;16;;\n')
    readings = read_readings(path, points, Layout(columns=layout))
    count = len(films.split())
    assert readings.layer.tolist()[:count] == layers.split()
    assert readings.thickness_um.tolist() == [*map(float, films.split()), 16]
    assert readings.point.tolist() == ['P1'] * count + ['P2']


def test_columns_of_repeats_and_a_layer_that_is_none_can_be_named(written, points):
    path = written('f.csv', 'Point;Layer;left;right\nP1;A7;20;21\nP2;B9;22;23\n')
    layout = Layout(columns={'thickness': ['left', 'right'], 'layer': 'none'})
    readings = read_readings(path, points, layout)
    assert readings.thickness_um.tolist() == [20, 21, 22, 23]
    assert set(readings.layer.tolist()) == {''}


def test_an_empty_cell_of_a_numbered_column_keeps_its_row(written, points):
    path = written('f.csv', '21,5;A\n22,5;A\n;A\n19,5;A\n')
    readings = read_readings(path, points, Layout(columns={'thickness': 1}))
    assert readings.point.tolist() == ['P1', 'P2', 'P4']


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        (BYK + 'C;1;90;20\n', "'No.' counts anew in each Checkzone; give a column 'point'"),
        ('No.;DFT\n1;20\n2;21\n1;22\n2;21\n3;20\n', "'No.' counts anew; give a column 'point'"),
        ('Reading;Thickness\n21,5;0,8\n22,5;0,8\n', "'Reading' counts the readings of a DeFelsko"),
    ],
)
def test_a_count_names_no_point(text, message, written, points):
    with pytest.raises(ReadingsError, match=message):
        read_readings(written('f.csv', text), points)


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
def test_numbers_of_points_are_no_count(text, labels, written, points):
    listed = points.with_name('numbers.csv')
    listed.write_text(points.read_text().replace('P', ''))
    assert read_readings(written('f.csv', text), listed).point.tolist() == labels.split()


def test_one_wrong_label_is_not_the_name_of_the_part(written, points):
    with pytest.raises(ReadingsError, match="the readings are called 'P9' to 'P9', and there is"):
        read_readings(written('f.csv', 'point;DFT\n' + 'P9;20\n' * 4), points)


def test_rounds_over_all_points_are_repeats(written, points):
    text = 'Round;No.;DFT\n' + ''.join(f'{r};{k};2{r}\n' for r in (1, 2) for k in range(1, 5))
    listed = points.with_name('numbers.csv')
    listed.write_text(points.read_text().replace('P', ''))
    assert read_readings(written('f.csv', text), listed).point.tolist() == [*'12341234']


def test_a_template_of_which_little_was_measured_is_warned_of(written, points):
    (doubt,) = read_readings(written('f.csv', 'Point;DFT\nP1;20\nP1;21\n'), points).doubts
    assert doubt.startswith('only 1 of the 4 points in points.csv have a reading; see whether')


def test_a_folder_with_several_tables_is_refused(written):
    with pytest.raises(ReadingsError, match=r'B2 holds a\.csv, b\.csv; name the one with the tab'):
        read_readings(written('B2', {'a.csv': 'DFT\n1\n', 'b.csv': 'DFT\n2\n'}))
