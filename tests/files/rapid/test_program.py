"""RAPID programs: what they are made of, their motion, and what cannot be followed."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import refusals
from paint_deposition.errors import PaintError, RecordingError
from paint_deposition.files.rapid import program as rapid
from paint_deposition.files.rapid.program import module_text, read_program
from paint_deposition.motion import programmed
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.programmed import GunSwitch, Move


def target(x, y=0.0, z=0.0, wxyz='1,0,0,0') -> str:
    return f'[[{x},{y},{z}],[{wxyz}],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]'


@pytest.fixture
def read(file):
    """`read(body, data='', **options)`: the program of a module with this `main` and data."""

    def read(body: str, data: str = '', procedures: str = '', **options) -> rapid.RapidProgram:
        text = f'MODULE Test\n{data}\nPROC main()\n{body}\nENDPROC\n{procedures}\nENDMODULE\n'
        return read_program(file('test.mod', text), **options)

    return read


refusal = partial(refusals.refusal, RecordingError)


def test_declared_targets_speeds_and_zones(read):
    data = f"""
    LOCAL CONST robtarget pStart:={target(100)};
    TASK PERS robtarget pEnd:={target(900)};
    CONST robtarget row{{2}}:=[{target(1)},{target(2)}];
    VAR speeddata vSlow:=[250.5,500,5000,1000];
    CONST zonedata zOwn:=[FALSE,7.5,11,11,1.1,11,1.1];
    CONST zonedata zStop:=[TRUE,7.5,11,11,1.1,11,1.1];
    VAR num step:=50;
    """
    body = r"""
    MoveJ pStart, v1000, FINE, tBell;
    movel PEND, vslow, zOwn, tBell \WObj:=wobj0;
    MoveL row{2}, v600\V:=450, zStop, tBell;
    MoveL Offs(pEnd,0,step,-2*step), vmax, z0, tBell;
    step := step + 10;
    MoveL RelTool(pEnd,0,0,step), v5, z200, tBell;
    pEnd.trans.z := 7;
    MoveL pEnd\ID:=10, [120,500,5000,1000], z10, tBell;
    """
    program = read(body, data)
    x = [move.position_m.tolist() for move in program.moves]
    expected = [[100, 0, 0], [900, 0, 0], [2, 0, 0], [900, 50, -100], [900, 0, 60], [900, 0, 7]]
    np.testing.assert_allclose(x, np.array(expected) * 1e-3, atol=1e-12)
    speeds = [move.speed_m_per_s for move in program.moves]
    assert speeds == pytest.approx([1.0, 0.2505, 0.45, 5.0, 0.005, 0.12])
    zones = [move.zone_m for move in program.moves]
    assert zones == pytest.approx([0.0, 0.0075, 0.0, 0.0003, 0.2, 0.01])
    assert "vmax is the robot's own; 5 m/s assumed" in program.notes


def test_poses_are_in_the_world(read):
    """World pose = user frame, then object frame, then target."""
    quarter = '0.7071068,0,0,0.7071068'
    frames = f'[[1000,0,0],[{quarter}]],[[0,100,0],[1,0,0,0]]'
    data = f'PERS wobjdata wPart:=[FALSE,TRUE,"",{frames}];'
    (move,) = read(rf'MoveL {target(10)},v100,fine,tBell\WObj:=wPart;', data).moves
    np.testing.assert_allclose(move.position_m, [0.9, 0.01, 0.0], atol=1e-9)
    quaternion = Rotation.from_euler('z', 90, degrees=True).as_quat()
    np.testing.assert_allclose(move.quaternion_xyzw, quaternion, atol=1e-7)
    unknown = read(rf'MoveL {target(10)},v100,fine,tBell\WObj:=wElse;')
    assert unknown.moves[0].position_m[0] == 0.01
    assert unknown.notes == ['work object welse is not in the module: poses are in its frame']


def test_outputs_and_triggers_switch_the_gun(read):
    body = rf"""
    TriggIO on,0\Start\DOp:=doGun,1;
    TriggEquip off,30,0.1\DOp:=doGun,0;
    SetDO doGun,0;
    MoveJ {target(0)},v600,fine,tBell;
    TriggL {target(1)},v600,on,z50,tBell;
    TriggL {target(2)},v600,off,z50,tBell;
    MoveL {target(3)},v600,z50,tBell;
    SetDO doGun,high;
    MoveL {target(4)},v600,z50,tBell;
    Reset doGun;
    MoveLDO {target(5)},v600,z50,tBell,doGun,1;
    MoveL {target(6)},v600,z50,tBell;
    """
    moves = read(body, 'CONST num high:=1;').moves
    assert [m.spraying for m in moves] == [False, True, True, False, True, False, True]
    assert moves[2].switches == (GunSwitch(0.03, False, False),)
    assert all(move.switches == () for move in moves if move is not moves[2])


@pytest.mark.parametrize(
    ('on', 'off', 'stays_open'),
    [('30', '50', True), ('50\\Start', '60\\Start', False), ('10\\Start', '95', True)],
)
def test_the_gun_stays_as_the_trigger_that_comes_last_leaves_it(read, on, off, stays_open):
    """In whichever order they are written, in a move of 100 mm."""
    triggers = f'TriggIO on,{on}\\DOp:=doGun,1;\nTriggIO off,{off}\\DOp:=doGun,0;'
    for both in ('on\\T2:=off', 'off\\T2:=on'):
        way = f'MoveL {target(0)},v600,fine,tBell;\nTriggL {target(100)},v600,{both},z50,tBell;'
        moves = read(f'{triggers}\n{way}\nMoveL {target(200)},v600,fine,tBell;').moves
        assert moves[-1].spraying == stays_open


def test_the_gun_is_one_of_several_outputs(read):
    body = f'SetDO doHorn,1;\nSet doGun;\nMoveL {target(1)},v600,fine,tBell;'
    assert 'sets dogun dohorn; give the one that opens the gun as' in refusal(read, body)
    assert read(body, gun_signal='doGun').moves[0].spraying
    assert 'never sets doFan; it sets: dogun dohorn' in refusal(read, body, gun_signal='doFan')


def test_the_only_procedure_is_where_it_starts(file):
    """Functions and traps are none; modules of older controllers have letters of ISO-8859-1."""
    path = file(
        'a.mod', f'MODULE A ! Tür\nPROC Door()\nMoveL {target(1)},v600,fine,tBell;\nENDPROC\n'
        'FUNC num one()\nRETURN 1;\nENDFUNC\nTRAP t\nStop;\nENDTRAP\nENDMODULE\n', 'latin-1',
    )  # fmt: skip
    assert len(read_program(path).moves) == 1
    with pytest.raises(RecordingError, match=r'no procedure one; its procedures: door$'):
        read_program(path, procedure='one')


def test_a_list_of_modules_names_files_beside_it(tmp_path):
    for name in ('', '../a.mod', 'in/a.mod'):
        (tmp_path / 'p.pgf').write_text(f'<Program><Module>{name}</Module></Program>')
        with pytest.raises(
            RecordingError, match=f"lists the module '{name}'; name modules that lie"
        ):
            read_program(tmp_path / 'p.pgf')


def test_conditions_without_moves_do_no_harm(read):
    body = f"""
    IF TestDI(diReady) THEN
      WaitDI diReady,0;
    ELSEIF reg1 > 3 + 1 THEN
      TPWrite "more ""than"" three \\Num:=" \\Num:=reg1;
    ELSE
      reg1 := 4;
    ENDIF
    IF reg1=2 Stop;
    TEST reg1 CASE 1,2: WaitTime 0.5; DEFAULT: Stop; ENDTEST
    again:
    MoveL {target(1)},v600,fine,tBell;
    """
    assert len(read(body).moves) == 1


NOWHERE = '[[0,0,0],[1,0,0,0]]'
# On one line, so that the first of the body is line 4.
DECLARED = (
    'VAR num none;VAR triggdata tr;'
    f'PERS tooldata tStill:=[FALSE,{NOWHERE},[1,[0,0,1],[1,0,0,0],0,0,0]];'
    f'PERS wobjdata wHeld:=[TRUE,TRUE,"",{NOWHERE},{NOWHERE}];'
    f'PERS wobjdata wBad:=[FALSE,TRUE,"",[[1,2],[1,0,0,0]],{NOWHERE}];'
)
START = f'MoveL {target(0)},v100,z10,tool0'


@pytest.mark.parametrize(('body', 'says'), [
    ('FOR i FROM 1 TO n DO\nMoveL p,v1,fine,t;\nENDFOR',
     'line 4: movel in line 5 is inside FOR and depends on n is not declared'),
    ('WHILE TRUE DO\nPaintL p,v1,fine,t;\nENDWHILE', 'line 4: WHILE never ends; name the'),
    ('WHILE reg1<1 DO\nreg2:=reg2+1;\nENDWHILE', 'line 4: WHILE never ends; name the'),
    ('FOR i FROM 1 TO 1E9 DO\nStop;\nENDFOR', 'line 4: FOR takes 10000 turns or more'),
    ('IF TestDI(di)\nMoveL p,v1,fine,t;', 'line 4: movel in line 5 is inside IF and depends'),
    ('TEST GInput(gi)\nCASE 1:\nSetBrush 2;\nENDTEST', 'setbrush in line 6 is inside TEST'),
    ('TPReadNum reg1,"Style";\nWHILE reg1>0 DO\nRETURN;\nENDWHILE', 'what tpreadnum reads in'),
    ('MoveL pElse,v100,fine,tBell;', 'line 4: pelse is not declared in the modules given'),
    ('MoveL row{2},v100,fine,tBell;', 'line 4: row is not declared in the modules given'),
    (f'MoveLSync {target(1)},v100,fine,tBell,"rGun";', 'line 4: movelsync is not understood'),
    ('SearchL di,p,p,v100,tBell;', 'line 4: searchl is not understood, and may move the'),
    ('IF TestDI(di) Incr reg1;\nSetBrush reg1;', 'line 5: reg1, which depends on testdi()'),
    (f'TriggL {target(1)},v1,on,z1,tBell;', 'line 4: on is not declared in the modules given'),
    ('GOTO again;', 'line 4: goto is not understood'),
    (r'MoveL p,v100,fine,tBell\Corr;', r'movel has no option \corr'),
    ('SetDO \\SDelay:=0.1,doGun,1;', 'line 4: setdo of the gun by time is not followed'),
    ('Set doGun;\nWaitDI di,1;', 'line 5: waitdi waits with the gun open'),
    ('Set doGun;\nMoveAbsJ [[0],[0]],v1,fine,tBell;', 'moveabsj sprays, and its joint ang'),
    (f'PaintL {target(1)},v100,bdMain,z10,tBell;', 'line 4: paintl takes bdmain beside'),
    ('UseBrushTab a;\nUseBrushTab b;', 'line 5: the brush table b after a: a number would'),
    ('SetBrush 1\\T:=3;', 'line 4: setbrush with t: give one of X, Y and Z'),
    (f'MoveExtJ [[0],[0]],v100,fine;{START};',
     'line 4: an external axis moves, and the work objects stand still'),
    ('p.trans.z:=7;', 'line 4: p has no such part to assign to'),
    (f'MoveL {target(1)},v100;', 'movel needs a target, a speed, a zone and a tool'),
    (START, "line 5: 'endproc' is not expected here; is a ';' missing before it?"),
    ('main;', 'procedure main calls itself'),
    ('MoveL #;', "line 4: '#' is not RAPID"),
    ('', 'has no moves of the TCP; nothing to read'),
    (r'MoveAbsJ [[0,0,0,0,0,0],[0,0,0,0,0,0]],v100,fine,tBell;', 'has no moves of the TCP'),
    (f'MoveL {target(1)},v100,fine,tStill;', 'tstill stands still'),
    (rf'{START}\WObj:=wHeld;', 'holds the work object wheld'),
    (f'{START};'.replace('1,0,0,0', '1,0,0,0.2'),
     'test.mod line 4: quaternion [1.0, 0.0, 0.0, 0.2] has the norm 1.0198'),
    (rf'{START}\WObj:=wBad;', 'is no position [x, y'),
    (f'MoveL {target("1e400")},v100,z10,tool0;', 'is no position [x, y'),
    ('none:=1/0;', 'line 4: division by zero'),
    ('SetBrush;', 'setbrush needs a number'),
    ('Add reg1;', 'line 4: add takes 2 arguments, not 1'),
    ('Incr;', 'line 4: incr takes 1 argument, not 0'),
    ('SetBrush 2.5;', 'line 4: setbrush takes the number of a brush, not 2.5'),
    ('TriggIO tr\\DOp:=doGun;', 'triggio needs a number'),
    (f'MoveL {target(0)},v100\\V:=[1],z10,tool0;', 'speed is [1.0]; a number expected'),
    (f'{START};MoveL {target(9)},v100\\T:=0,z1,tool0;',
     'line 4: a duration of 0 s; give one above 0'),
    (f'MoveL Offs({target(0)},0,0,[1]),v1,z1,tool0;',
     '[0.0, 0.0, [1.0]] is no displacement; give three numbers'),
])  # fmt: skip
def test_what_cannot_be_followed_is_named(read, body, says):
    assert says in refusal(read, body, DECLARED)


def test_an_option_of_a_procedure_is_handed_on_and_a_misspelt_one_refused(read):
    move = f'MoveL {target("x")},v600\\V?Speed,z1,tBell;'
    passes = f'PROC Pass(num x \\num Speed)\n{move}\nENDPROC'
    program = read(r'Pass 1\Speed:=300;Pass 2;', procedures=passes)
    assert [move.speed_m_per_s for move in program.moves] == [0.3, 0.6]
    says = refusal(read, 'Pass 1\\Sped:=300;', procedures=passes)
    assert "pass has no option \\sped; did you mean 'speed'?" in says


def test_paint_in_two_frames_or_with_two_tools_is_refused(read):
    for how, refused in (('tBell\\WObj:=wElse', 'it sprays in frames whose relation is not known'),
                         ('tOther', 'it sprays with')):  # fmt: skip
        way = f'MoveL {target(1)},v100,fine,{how};'
        body = f'{{}}\n{way}\nSet doGun;\nMoveL {target(2)},v100,fine,tBell;'
        assert any('are left out' in note for note in read(body.format('')).notes)
        assert refused in refusal(read, body.format('Set doGun;'))


@pytest.mark.parametrize('paint_moves', [False, True])
def test_what_is_written_is_read_back(tmp_path, paint_moves):
    rng, path = np.random.default_rng(4), tmp_path / 'passes.mod'
    moves = [
        Move(rng.uniform(-3.0, 3.0, 3), turn, rng.uniform(0.01, 5.0), bool(k and rng.integers(2)),
             flow=1.0 if paint_moves else rng.choice([0.8, 1.0]), brush=int(rng.integers(1, 3)))
        for k, turn in enumerate(Rotation.random(60, random_state=5).as_quat())
    ]  # fmt: skip
    path.write_text(module_text(moves, paint_moves=paint_moves))
    end = 'SetBrush 0' if paint_moves else 'SetDO doGun,0'
    assert path.read_text().endswith(f'    {end};\n  ENDPROC\nENDMODULE\n')
    assert ('PaintL' in path.read_text()) == paint_moves
    read = read_program(path)
    for planned, again in zip(moves, read.moves, strict=True):
        guns = [(m.spraying, m.spraying * m.brush, m.spraying * m.flow) for m in (planned, again)]
        assert guns[0] == guns[1]
        np.testing.assert_allclose(again.position_m, planned.position_m, rtol=0, atol=0.6e-6)
        turns = Rotation.from_quat([again.quaternion_xyzw, planned.quaternion_xyzw])
        assert (turns[0].inv() * turns[1]).magnitude() < 1e-6
        assert again.speed_m_per_s == pytest.approx(planned.speed_m_per_s, abs=1e-6)
        assert again.switches == ()
    with pytest.raises(PaintError, match='flows of single passes need brushes of their own'):
        module_text([replace(move, flow=0.8) for move in moves], paint_moves=True)
    for no_speed in (0.0, 10.0):
        with pytest.raises(PaintError, match=f'speed of {no_speed:g} m/s: give one above 0'):
            module_text([replace(moves[0], speed_m_per_s=no_speed)])


def down(x, y=0.0, wxyz='0,1,0,0') -> str:
    return target(x, y, 250.0, wxyz)


@pytest.fixture
def motion(read):
    """`motion(body)`: the trajectory of a module with this `main`."""
    return lambda body: rapid.program_trajectory(read(body))


def test_a_program_without_a_gun_sprays_all_the_way_and_says_so(motion, shared_data):
    program = read_program(shared_data / 'rapid/ECL_Grey_T_ROB1.mod')
    trajectory = rapid.program_trajectory(program)
    legs = np.diff([move.position_m for move in program.moves], axis=0)
    expected_s = np.linalg.norm(legs, axis=1).sum() / 0.1
    path, counts = spray_path(trajectory)
    assert path.spraying_time_s == pytest.approx(expected_s, rel=1e-9)
    assert counts.rejected == counts.gaps == 0
    told = 'nothing in the program switches the gun: it is taken as spraying throughout'
    assert told in trajectory.notes
    assert 'joint moves are taken as straight' in trajectory.notes


@pytest.mark.parametrize('sweep_deg', [30.0, 180.0, 300.0])
def test_circular_moves_are_arcs(motion, sweep_deg):
    middle, end = np.radians([0.4 * sweep_deg, sweep_deg])
    via, last = ((200 * np.cos(a), 200 * np.sin(a)) for a in (middle, end))
    trajectory = motion(
        f'MoveL {down(200)},v100,fine,tool0;'
        f'MoveC {down(*np.round(via, 9))},{down(*np.round(last, 9))},v100,z10,tool0;'
    )
    assert 'zones are not followed: corners are sharp' in trajectory.notes
    radius_m = np.linalg.norm(trajectory.positions_m[:, :2], axis=1)
    np.testing.assert_allclose(radius_m, 0.2, atol=1e-9)
    assert trajectory.duration_s == pytest.approx(0.2 * end / 0.1, abs=1e-6)


def test_a_tool_that_only_turns_takes_its_time(motion):
    w, x, y, z = Rotation.from_euler('z', 90.0, degrees=True).as_quat()[[3, 0, 1, 2]]
    trajectory = motion(
        f'MoveL {down(0, wxyz="1,0,0,0")},v500,fine,tool0;'
        f'MoveL {down(0, wxyz=f"{w},{x},{y},{z}")},v500,fine,tool0;'
    )
    assert trajectory.duration_s == pytest.approx(90.0 / 500.0, abs=1e-6)
    assert np.all(np.ptp(trajectory.positions_m, axis=0) == 0.0)


@pytest.mark.parametrize('move', [
    f'MoveC {down(100, 100)},{down(0, 200)},v100\\T:=4,fine,tool0;',
    f'MoveL {down(0, wxyz="0,0.8,0.6,0")},v100\\T:=4,fine,tool0;',
    f'VelSet 50,5000;MoveL {down(100)},v100\\T:=2,fine,tool0;',
])  # fmt: skip
def test_a_move_takes_the_time_that_it_is_given(motion, move):
    trajectory = motion(f'MoveL {down(0)},v100,fine,tool0;{move}')
    assert trajectory.duration_s == pytest.approx(4.0, abs=1e-9)


@pytest.mark.parametrize(('end', 'speed', 'words'), [
    ('', '', 'a single move'),
    (down(1000), f'v100,fine,tool0;MoveL {down(0)},v100', 'line 5: the program runs for over'),
    (down(1), '[0,500,0,0]', 'speed 0 m/s'),
    (down('1e12'), 'v100', r'line 5: a move of 1e\+09 m at 0.1 m/s takes .* h'),
])  # fmt: skip
def test_what_is_no_motion_is_refused(motion, end, speed, words, monkeypatch):
    monkeypatch.setattr(programmed, 'LONGEST_S', 9.0)
    second = f'MoveL {end},{speed},fine,tool0;' if end else ''
    with pytest.raises(RecordingError, match=words):
        motion(f'MoveL {down(0)},v500,fine,tool0;\n{second}')
