"""Campaign files: what is read with them, and one clear line for each fault."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml

import paint_deposition as pd
from refusals import refusal

SAMPLE = 'ros2_ws/src/paint_deposition/samples/measured_door'
DOOR = {
    'name': 'door', 'mesh': 'door.stl', 'trajectory': 'door', 'pose_topic': '/atomizer/pose',
    'measurements': 'door.csv',
}  # fmt: skip


@pytest.fixture(scope='module')
def folder(repository, tmp_path_factory) -> Path:
    """The sample door's files; the test writes its campaign file beside them."""
    folder = tmp_path_factory.mktemp('campaign')
    return Path(shutil.copytree(repository / SAMPLE, folder / 'door'))


@pytest.fixture
def campaign(folder):
    """`campaign(key=value, ...)`: a campaign file of one experiment with these keys changed."""

    def write(top: dict | None = None, **changes: object) -> Path:
        entry = {key: value for key, value in (DOOR | changes).items() if value is not ...}
        content = {'experiments': [entry]} | (top or {})
        path = folder / 'one.yaml'
        path.write_text(yaml.safe_dump(content))
        return path

    return write


def changed_readings(folder: Path, change) -> str:
    """A copy of the door's readings with `change(values)` made to every row; its name."""
    header, *rows = (folder / 'door.csv').read_text().splitlines()
    fields = (dict(zip(header.split(','), row.split(','), strict=True)) for row in rows)
    lines = [','.join(change(row)) for row in fields]
    (folder / 'changed.csv').write_text('\n'.join([header, *lines]) + '\n')
    return 'changed.csv'


def test_the_sample_arrives_whole(repository):
    lines = []
    campaign = pd.read_campaign(repository / SAMPLE / 'campaign.yaml', lines.append)
    assert [e.name for e in campaign.experiments] == ['panel', 'door']
    assert lines[0] == 'reading panel'
    door = campaign.experiments[1]
    assert len(door.readings) == len(campaign.readings) - len(campaign.experiments[0].readings)
    assert len(door.points) == 3 * len(door)  # each with a neighbour up and one down the surface
    assert door.files['mesh'].endswith('measured_door/door.stl')
    assert set(door.groups) - {''}


def test_what_the_file_says_is_taken_over(campaign, folder):
    head = {'part': 'door', 'batch': 4711, 'date': '2026-11-21'}
    top = head | {'target_um': 25, 'tolerance_um': 3.5, 'model': 'start.yaml'}
    off = ['voltage', 'draught']
    read = pd.read_campaign(campaign(top=top, down=[0, 0, -9.81], name=7, switched_off=off))
    (one,) = read.experiments
    assert (read.model_file, one.name) == (str(folder / 'start.yaml'), '7')
    assert one.surface.down.tolist() == [0, 0, -1]
    assert read.head == head | {'batch': '4711'}
    assert (read.target_um, read.tolerance_um) == (25.0, 3.5)
    without = read.without(np.arange(len(read.readings)) == 0)
    assert without.head == read.head
    assert one.switched_off == without.experiments[0].switched_off == {*off}
    assert read.target_of(one) == (25.0, 3.5)
    own = pd.read_campaign(campaign(top=top, target_um=30, tolerance_um=5))
    assert own.target_of(own.experiments[0]) == (30.0, 5.0)


def test_a_trigger_that_is_not_named_is_noted(campaign):
    """Without it the gun would spray on the way between passes, which changes every answer."""
    said = []
    pd.read_campaign(campaign(), remark=lambda *line: said.append(line))
    (note,) = (line for kind, _, line in said if kind == 'note' and 'state_topic' in line)
    assert '/atomizer/state (std_msgs/msg/Bool) is not used' in note
    assert 'add `state_topic: /atomizer/state`' in note


@pytest.mark.parametrize(
    ('changes', 'message'),
    [
        ({'mesh': ...}, "experiment 1 has no 'mesh'; give the name of a mesh file"),
        ({'mesh': 'gate.stl'}, r"experiment 'door': .*gate\.stl: no such mesh file"),
        ({'trajectory': 'nowhere'}, "experiment 'door': .*nowhere"),
        ({'pose_topic': '/pose'}, "experiment 'door': .*/atomizer/pose"),
        ({'measurement': 'door.csv'}, "unknown key 'measurement'; did you mean 'measurements'"),
        ({'mesh_scale': 0}, 'mesh_scale is 0; expected a number above 0: metres per unit'),
        ({'max_pose_gap_s': 'long'}, "max_pose_gap_s is 'long'; expected a number above 0"),
        ({'down': 'z'}, r"down is 'z'; expected gravity in the mesh frame, three"),
        (
            {'down': [0, 0, float('nan')]},
            'down.2 is nan; expected gravity in the mesh frame, three',
        ),
        ({'columns': {'thick': 'DFT'}}, "columns.thick is 'thick'; expected the heading.* x, y"),
        ({'columns': {'x': ['a', 'b']}}, 'x has one column; only thickness may have a list'),
        ({'columns': {'layers': 'a'}}, "give 'layers' the columns by the names of the layers"),
        ({'unit': {'thickness': 'inches'}}, "thickness is 'inches'; expected position: m, mm"),
        ({'points': 'none.csv'}, r'none\.csv: no such file'),
        ({'switched_off': ['light']}, r"switched_off.0 is 'light'; expected"),
        ({'top': {'models': 'm.yaml'}}, "campaign: unknown key 'models'; .* 'model'"),
        ({'top': {'experiments': []}}, r'experiments is \[\]; expected a list of at least one'),
        ({'top': {'target_um': 20}}, 'target_um and tolerance_um belong together'),
        (
            {'top': {'target_um': 45, 'tolerance_um': 60}},
            'tolerance_um 60 is not less than target',
        ),
        ({'top': {'target_um': -1, 'tolerance_um': 1}}, 'target_um is -1; expected the film want'),
        ({'top': {'experiments': [DOOR, DOOR]}}, "two experiments are called 'door'; rename one"),
    ],
)
def test_a_fault_is_refused_in_one_line(campaign, changes, message):
    path = campaign(**changes)
    line = refusal(pd.PaintError, pd.read_campaign, path)
    assert re.search(message, line), line
    assert line.startswith(str(path))


def test_a_file_that_is_no_campaign_is_refused(tmp_path, file):
    with pytest.raises(pd.PaintError, match='no such file; give a campaign YAML'):
        pd.read_campaign(tmp_path / 'campaign.yaml')
    with pytest.raises(pd.PaintError, match='campaign is text; expected the keys experiments, '):
        pd.read_campaign(file('campaign.yaml', 'just words'))


def test_readings_a_few_mm_off_are_moved_and_it_is_said(campaign, folder):
    def off(row):
        return [str(float(v) - 0.004) if k == 'y_m' else v for k, v in row.items()]

    read = pd.read_campaign(campaign(measurements=changed_readings(folder, off)))
    (line,) = read.understood
    assert line.startswith('door: changed.csv: ')
    assert 'commas, UTF-8; x, y, z in m, thickness in µm; moved onto the surface by' in line
    door = read.experiments[0]
    assert 0.003 < np.median(door.off_surface_m) <= door.off_surface_m.max() < 0.0041
    assert f'{1e3 * np.median(door.off_surface_m):.1f} mm (median)' in line


def test_readings_join_their_listed_points(campaign, folder):
    rows = [row.split(',') for row in (folder / 'door.csv').read_text().splitlines()]
    at = {name: rows[0].index(name) for name in rows[0]}
    film = ['Messpunkt;Schichtdicke [µm]']
    film += [f'{r[at["point"]]};{r[at["thickness_um"]].replace(".", ",")}' for r in rows[1:]]
    (folder / 'film.txt').write_bytes('\n'.join(film).encode('cp1252'))
    read = pd.read_campaign(campaign(measurements='film.txt', points='door.csv'))
    as_before = pd.read_campaign(campaign()).experiments[0].readings
    joined = read.experiments[0].readings
    assert joined.thickness_um.tolist() == as_before.thickness_um.tolist()
    assert joined.positions_m.tolist() == as_before.positions_m.tolist()
    assert joined.point.tolist() == as_before.point.tolist()


def test_teeth_of_a_comb_read_low_and_as_likely_anywhere_in_their_step(campaign, folder):
    def tooth(row):
        return [str(float(v) // 5 * 5) if k == 'thickness_um' else v for k, v in row.items()]

    comb = changed_readings(folder, tooth)
    dry = pd.read_campaign(campaign(measurements=comb)).readings
    read = pd.read_campaign(campaign(measurements=comb, wet=True, solids=0.4))
    assert read.readings.thickness_um == pytest.approx(0.4 * (dry.thickness_um + 2.5))
    assert read.readings.sigma_um == pytest.approx(0.4 * 5.0 / 12**0.5)
    assert 'a comb in steps of 5 µm, half of which is added' in read.understood[0]


def test_what_an_experiment_says_of_its_motion_holds_for_its_guns(campaign):
    """Not the default of a gun that says nothing."""
    guns = [{'trajectory': 'door'}, {'trajectory': 'door', 'tool_axis': 'z'}]
    one = pd.read_campaign(campaign(guns=guns, tool_axis='-z')).experiments[0]
    first, second = np.split(one.path.rotation[:, :, 2], 2)
    assert first == pytest.approx(-second)


def test_normals_pointing_into_the_part_are_refused(campaign, folder):
    rows = (folder / 'door.csv').read_text().splitlines()
    inward = [f'{rows[0]},nx,ny,nz', *(f'{row},0,-1,0' for row in rows[1:])]
    (folder / 'inward.csv').write_text('\n'.join(inward) + '\n')
    message = r'normals point away from the surface.*give outward normals'
    with pytest.raises(pd.PaintError, match=message):
        pd.read_campaign(campaign(measurements='inward.csv'))
