"""What a command cannot do it refuses in one line, and writes nothing."""

import shlex
from importlib.util import find_spec

import pytest
import trimesh

from booth import SAMPLES
from cli.command import BRUSHES, assert_refused, paint
from folded_parts import hood

FILES = {
    'poses.csv': 't,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n', 'notes.py': '', 'passes.mod': '',
    'readings.csv': 'x_m,y_m,z_m,thickness_um\n0,0,0,20\n', 'bell.yaml': 'effects: []\n',
    'off.csv': 'x_m,y_m,z_m,thickness_um\n0,0,0.6,9\n0,0.5,0.6,9\n', 'brushes.yaml': BRUSHES,
}  # fmt: skip
COARSE = '--max-edge-length-m 0.06'
PANEL = f'simulate --mesh panel.stl --trajectory panel_577 {COARSE}'
DOOR = f'--mesh door.stl --trajectory door_horizontal {COARSE}'
GUNS = f'{PANEL} --trajectory panel_577'
IMPROVE = f'improve {DOOR} --state-topic /atomizer/state'
PLAN = 'plan --mesh door.stl --speed 0.3'
CAMPAIGN = 'measured_door/campaign.yaml'
NO_WINDOW = pytest.mark.skipif(find_spec('rerun') is not None, reason='Rerun opens a window')


@pytest.fixture(scope='module')
def jobs(tmp_path_factory):
    """The samples and files of a user."""
    folder = tmp_path_factory.mktemp('jobs')
    for sample in SAMPLES.iterdir():
        (folder / sample.name).symlink_to(sample)
    for name, text in FILES.items():
        (folder / name).write_text(text)
    folded = hood(0.06)
    trimesh.Trimesh(folded.vertices_m, folded.faces, process=False).export(folder / 'hood.ply')
    return folder


@pytest.mark.parametrize(('words', 'told'), [
    ('simulate --mesh nowhere.stl --trajectory panel_577', 'nowhere.stl: no such mesh file'),
    ('simulate --mesh notes.py --trajectory panel_577', '.py|.stl'),
    ("simulate --mesh '' --trajectory panel_577", '--mesh is empty'),
    ("simulate --mesh panel.stl --trajectory ''", '--trajectory is empty'),
    ('simulate --mesh panel.stl --trajectory nowhere',
     'nowhere: no such file; give a bag, a table of poses or'),
    # The name of a file is no option.
    ('simulate --mesh panel.stl --trajectory part_pose.csv', 'part_pose.csv: no such file'),
    (f'{PANEL} --model nowhere.yaml', 'nowhere.yaml|no such file'),
    (f'{PANEL} --mesh-scale -1', '--mesh-scale|-1'),
    (f'{PANEL} --max-edge-length-m 1e-6', 'max_edge_length_m = 1e-06 m would|at least 0.00'),
    (f'{PANEL} --tolerance-um 3', '--target-um'),
    (f'{PANEL} --tolerance-um 60 --target-um 45', 'bare metal would be within it'),
    (f'{PANEL} --down 0 0 0', 'down|give the direction of gravity'),
    (f'{PANEL} --at off.csv', "off.csv|off the part's surface|0.5"),
    (f'{GUNS} --model bell.yaml --model bell.yaml --model bell.yaml', '--model is given 3 times'),
    (f'{GUNS} --atomizer a --atomizer b --atomizer c', '2 files for 3 atomizers'),
    (f'{GUNS} --atomizer a --atomizer b --pose-topic /p', 'leave out --atomizer, or'),
    ('simulate --mesh door.stl --trajectory passes.mod --state-topic /atomizer/state',
     '--state-topic is for bags|is a RAPID module; leave it out'),
    (f'simulate {DOOR} --gun-signal doGun', '--gun-signal is for RAPID modules'),
    ('recommend', 'neither --speed nor --target-um'),
    ('recommend --speed -1', "'--speed': -1.0 is not in the range"),
    ('recommend --speed 0.2 --tolerance 5', 'wanted: Largest sigma_n accepted, 0.05 for 5 %'),
    ('recommend --speed 0.3 --model brushes.yaml',
     'an index is for one brush and the model has 1, 2, 3: say which (brush)'),
    ('recommend --speed 0.3 --model brushes.yaml --brush 8',
     'brush 8 is not in the model; its brushes: 1, 2, 3'),
    ('recommend --speed 0.3 --model bell.yaml --brush 2',
     'brush 2 is not in the model: it has one pattern, planar, without a'),
    ('plan --mesh door.stl', 'neither --speed nor --target-um'),
    (f'{PLAN} --index -1', "'--index'"), (f'{PLAN} --index 577', '<=10.0, in metres'),
    (f'{PLAN} --standoff 250', '<=10.0, in metres'),
    (f'{PLAN} --outward 0 nan 0', 'nan is not finite'),
    (f'{PLAN} --outward 0 0 0', 'give a direction'),
    (f'{PLAN} --tip tool0', '--tip goes with a robot'),
    (f'{PLAN} --face-angle-deg 30', 'give --faces auto'),
    (f'{PLAN} --time-weight 0', 'is for --optimise'),
    ('plan --mesh hood.ply --faces auto --target-um 20 --face-angle-deg 90', '90'),
    (f'{IMPROVE} --speed-min 0.5 --speed-max 0.2', '--speed-min is 0.5, above --speed-max'),
    (f'{IMPROVE} --flow 0 1', '--flow|0.0'), (f'{IMPROVE} --acceleration fast', 'fast'),
    (f'{IMPROVE} --joint-acceleration 2', '--joint-acceleration goes with a robot; give --urdf'),
    (f'{IMPROVE} --urdf robot.urdf', '--urdf needs --part-pose'),
    (f'measure --mesh door.stl {COARSE}', '--trajectory|--target-um'),
    (f'measure {DOOR} --target-um 20', 'leave one of them out'),
    (f'measure {DOOR} --brush 2', 'leave one of them out'),
    ('diagnose nowhere.yaml', 'nowhere.yaml: no such file|give a campaign YAML'),
    (f'diagnose {CAMPAIGN} --effect-file mine.py', 'mine.py'),
    (f'compare {CAMPAIGN} --model none.yaml', 'none.yaml: no such file'),
    (f'compare {CAMPAIGN} --model bell.yaml --model bell.yaml', 'given twice'),
    (f'refit {CAMPAIGN} --add air_drft', "'air_drft'|did you mean 'air_drift'?"),
    (f'refit {CAMPAIGN} --add mine.py', 'mine.py'),
    (f'refit {CAMPAIGN}', "Missing option '--add'"),
    (f'refit {CAMPAIGN} --add edge_build --as-effect a.py', 'learned:COVARIATE'),
    ('recover nowhere', 'nowhere'), ('inspect nowhere', 'nowhere'),
    ('inspect', 'RECORDING'), (f'compare {CAMPAIGN}', "Missing option '-o'"),
    ('inspect door_horizontal --out a.png', '--mesh'),
    ('inspect door_horizontal --mesh door.stl -o notes.py', 'not drawn by paint; choose another'),
    ('inspect door.stl --tf a b', '--tf: not for a mesh; leave it'),
    ('inspect door.stl --max-edge-length-m 0.1', '--max-edge-length-m: not for a mesh; leave it'),
    ('inspect readings.csv --strict', '--strict: not for gauge readings; leave it'),
    ('inspect readings.csv --mesh-scale 1', '--mesh-scale: not for gauge readings; leave it'),
    ('inspect door_horizontal --body door', '--body: not for a bag; leave it'),
    ('inspect door_horizontal --frame-id a', '--frame-id: not for a bag; leave it'),
    ('inspect poses.csv --tool-axis x', '--tool-axis: not for a table of poses; leave it'),
    ('inspect door_horizontal --gun-signal doGun', '--gun-signal is for RAPID modules'),
    ('locate --touched readings.csv', "Missing option '--points'"),
    ('place --trajectory door_horizontal --urdf robot.urdf', '--part-pose'),
    ('watch', 'give RUN, or --live'), ('watch --live', 'give --mesh'),
    ('watch --live --mesh door.stl --rate 4', '--rate is for a recorded RUN'),
    ('watch nowhere', 'is not there; give a recorded run'),
    ('watch . --port 0', 'does not name the mesh'),
    ('watch nowhere --tolerance-um 2', 'no --target-um'),
    pytest.param('view .', 'no .mcap file', marks=NO_WINDOW),
    pytest.param('view door_horizontal', 'pip install rerun-sdk', marks=NO_WINDOW),
])  # fmt: skip
def test_what_a_command_cannot_do_is_one_line_and_nothing_is_written(words, told, jobs, tmp_path):
    command, *rest = shlex.split(words)
    no_output = command in ('inspect', 'locate', 'view', 'watch') or "'-o'" in told
    output = () if no_output else ('-o', tmp_path / 'out')
    assert_refused(paint(command, *rest, *output, cwd=jobs), *told.split('|'))
    assert not list(tmp_path.iterdir())


def test_an_output_that_is_a_file_is_refused(jobs, tmp_path):
    (tmp_path / 'out').write_text('a file')
    done = paint(*shlex.split(PANEL), '-o', tmp_path / 'out', cwd=jobs)
    assert_refused(done, '-o', 'is a file')
