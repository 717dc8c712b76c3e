"""Nine paint programs, each with the poses that it means, worked out by plain arithmetic."""

import math

import numpy as np
import pytest

import paint_deposition as pd

AXES = '[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]'
DOWN = '[0,1,0,0]'  # tool z toward the panel
STEP_S = 0.02


def target(x, y, z=250) -> str:
    return f'[[{x},{y},{z}],{DOWN},{AXES}]'


class Poses:
    """A table of poses over time: rows of time [s], place [mm], gun and brush."""

    def __init__(self, x, y, z=250.0):
        self.rows = [[0.0, x, y, z, 0, 0]]

    def go(self, x, y, v, brush=0, flow=1.0, z=250.0):
        """Straight to a place at a speed [mm/s]; with a brush the gun is open."""
        begin = np.array(self.rows[-1][1:4])
        way = np.array([x, y, z]) - begin
        return self._along(lambda s: begin + s * way, math.hypot(*way) / v, brush, flow)

    def stay(self, seconds, brush):
        at = self.rows[-1][1:4]
        return self._along(lambda s: at, seconds, brush, 1.0)

    def _along(self, place, duration, brush, flow):
        start, flow, brush = self.rows[-1][0], flow * bool(brush), brush or self.rows[-1][5]
        count = math.ceil(duration / STEP_S)
        for share in np.arange(1, count + 1) / max(count, 1):
            self.rows[-1][4:] = flow, brush
            self.rows.append([start + share * duration, *place(share), 0, brush])
        return self

    @property
    def trajectory(self) -> pd.Trajectory:
        time_s, *place, flow, brush = np.array(self.rows).T
        stamps = np.round(time_s * 1e9).astype(np.int64)
        gun = np.array([flow, brush * (flow > 0.0)])
        changes = np.append(True, (np.diff(gun) != 0.0).any(axis=0))
        return pd.Trajectory(
            stamps, np.array(place).T * 1e-3, np.tile([1.0, 0.0, 0.0, 0.0], (len(stamps), 1)),
            trigger_stamps_ns=stamps[changes], trigger_flow=flow[changes],
            trigger_brush=brush[changes].astype(np.int64),
        )  # fmt: skip


def zigzag():
    """The loop of a flat part, and an auxiliary output that is no gun."""
    poses = Poses(0, 0)
    for k in range(4):
        ends = (0, 600) if k % 2 == 0 else (600, 0)
        poses.go(ends[0], 100 * k, 500).go(ends[1], 100 * k, 600, brush=1)
    main = rf"""
        VAR num y:=0; VAR robtarget a; VAR robtarget b;
        ConfL\Off;
        SetDO doFanOn,1;
        MoveL {target(0, 0)},v500,fine,tGun;
        SetBrush 1;
        FOR i FROM 0 TO 3 DO
            y:=i*100;
            IF i MOD 2=0 THEN
                a:=[[0,y,250],{DOWN},{AXES}];  b:=[[600,y,250],{DOWN},{AXES}];
            ELSE
                a:=[[600,y,250],{DOWN},{AXES}];  b:=[[0,y,250],{DOWN},{AXES}];
            ENDIF
            MoveL a,v500,fine,tGun;
            PaintL b,v600,z30,tGun;
        ENDFOR
        Reset doFanOn;"""
    return main, poses


def arrays():
    """Heights, speeds and brushes of the strokes in arrays, and WHILE."""
    poses = Poses(0, 50)
    for y, v, brush in ((50, 400, 1), (130, 500, 2), (240, 600, 1)):
        poses.go(0, y, 1000).go(500, y, v, brush)
    main = rf"""
        VAR num n:=1; VAR robtarget p:={target(0, 0)};
        CONST num stroke{{3,3}}:=[[50,400,1],[130,500,2],[240,600,1]];
        WHILE n<=Dim(stroke,1) DO
            p.trans.x:=0;  p.trans.y:=stroke{{n,1}};
            MoveL p,v1000,fine,tGun;
            SetBrush stroke{{n,3}};
            p.trans.x:=p.trans.x+500;
            PaintL p,v50\V:=stroke{{n,2}},fine,tGun;
            Incr n;
        ENDWHILE"""
    return main, poses


def procedures():
    """Arguments, an optional one, a function, and one that comes back."""
    poses = Poses(100, 0)
    for x, brush in ((100, 1), (220, 2)):
        poses.go(x, 0, 800).go(x, 400, 500, brush)
    poses.go(340, 0, 800).go(340, 400, 250, 1)
    main = r"""
        VAR num x:=100;
        rStroke x\nBrush:=2-1;
        rStroke x\nBrush:=2;
        rStroke x\slow;
    ENDPROC
    PROC rStroke(INOUT num x \num nBrush|switch slow)
        VAR speeddata v:=v500;
        IF Present(slow) v.v_tcp:=v.v_tcp/2;
        IF NOT Present(nBrush) SetBrush 1;
        IF Present(nBrush) SetBrush nBrush;
        MoveL fAt(x,0),v800,fine,tGun;
        PaintL fAt(x,400),v,fine,tGun;
        x:=x+120;
    ENDPROC
    FUNC robtarget fAt(num x,num y)
        RETURN Offs(pOrigin,x,y,0);
    ENDFUNC
    PROC rUnused()
        SearchL di,p,p,v1,tGun;"""
    return main, poses


def styles():
    """TEST on the style of the part, RETURN, EXIT; speeds limited by VelSet; a displacement."""
    poses = Poses(0, 60).go(500, 60, 300, 2).go(500, 160, 250, 2)
    main = rf"""
        VAR num style:=3;
        VelSet 50,300;
        AccSet 80,80;
        TEST style
        CASE 1,2: rOther;
        CASE 3: rHood style;
        DEFAULT: Stop;
        ENDTEST
        PaintL {target(0, 0)},v10,fine,tGun;
    ENDPROC
    PROC rHood(num style)
        PDispSet [[0,60,0],[1,0,0,0]];
        MoveJ {target(0, 0)},v1000,fine,tGun;
        SetBrush 2;
        PaintL {target(500, 0)},v1000,z10,tGun;
        PaintL {target(500, 100)},v500,fine,tGun;
        IF style=3 AND NOT FALSE THEN EXIT; ENDIF
    ENDPROC
    PROC rOther()
        MoveL {target(9, 9)},v10,fine,tGun;"""
    return main, poses


def planes():
    """Brushes that change at planes of a work object that is turned and shifted."""
    poses = Poses(100, 0).go(100, 100, 500).go(100, 250, 500, 1).go(100, 400, 500, 2)
    poses.go(100, 600, 500)
    main = rf"""
        MoveL [[0,0,0],{DOWN},{AXES}],v500,fine,tGun\WObj:=wTurned;
        SetBrush 0;
        SetBrush 1\X:=100;
        SetBrush 2\X:=250;
        SetBrush 0\X:=400;
        PaintL [[600,0,0],{DOWN},{AXES}],v500,fine,tGun\WObj:=wTurned;"""
    # The work object turns the tool about its own axis, and the target turns it back.
    quarter = f'[{math.sqrt(0.5)},0,0,{math.sqrt(0.5)}]'
    turned = f'[0,{math.sqrt(0.5)},{-math.sqrt(0.5)},0]'
    main = main.replace(DOWN, turned)
    declared = (
        f'PERS wobjdata wTurned:=[FALSE,TRUE,"",[[60,0,250],[1,0,0,0]],[[40,0,0],{quarter}]];'
    )
    return main, poses, declared


def conveyor():
    """A part on a conveyor: the way to it is left out, and poses are those on the part."""
    poses = Poses(0, 80).go(600, 80, 400, 2).go(600, 200, 1000).go(0, 200, 400, 2)
    wobj = r'tGun\WObj:=wPart'
    main = rf"""
        MoveAbsJ [[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,z50,tGun;
        MoveJ {target(-900, 900, 900)},v1000,z50,tGun;
        ActUnit CNV1;
        WaitWObj wPart\RelDist:=300;
        MoveL {target(0, 0)},v1000,fine,{wobj};
        SetBrush 2;
        PaintL {target(600, 0)},v400,z10,{wobj};
        SetBrush 0;
        PaintL {target(600, 120)},v1000,z10,{wobj};
        SetBrush 2;
        PaintL {target(0, 120)},v400,z10,{wobj};
        DropWObj wPart;
        MoveJ {target(-900, 900, 900)},v1000,z50,tGun;
        DeactUnit CNV1;"""
    moving = 'PERS wobjdata wPart:=[FALSE,FALSE,"CNV1",[[9,9,9],[1,0,0,0]],[[0,80,0],[1,0,0,0]]];'
    return main, poses, moving


def outputs():
    """The gun by an output, its flow and brush by others, and a wait with the gun open."""
    poses = Poses(0, 100).go(100, 100, 500).go(450, 100, 500, 1, flow=0.8).go(500, 100, 500)
    poses.go(500, 300, 500).stay(0.4, 2).go(0, 300, 500, 2)
    main = rf"""
        TriggIO on,100\Start\DOp:=doGun,1;
        TriggIO off,50\DOp:=doGun,0;
        SetDO doGun,0;
        SetAO aoFlow,0.8;
        SetGO goBrush,1;
        MoveJ {target(0, 100)},v500,fine,tGun;
        TriggL {target(500, 100)},v500,on\T2:=off,fine,tGun;
        MoveL {target(500, 300)},v500,fine,tGun;
        SetAO aoFlow,1;
        SetGO goBrush,2;
        Set doGun;
        WaitTime \InPos,0.4;
        MoveL {target(0, 300)},v500,fine,tGun;
        Reset doGun;"""
    return main, poses, 'VAR triggdata on; VAR triggdata off;'


def tools():
    """The way to the part with tool0, times instead of speeds, displacements along the tool."""
    poses = Poses(0, 0).go(300, 0, 150, 1).go(300, 150, 1000)
    poses.go(0, 150, 500, 1)
    main = rf"""
        MoveJ {target(0, 0, 550)},v1000,fine,tool0;
        MoveL {target(0, 0, 250)},v1000,fine,tGun;
        SetBrush 1;
        PaintL RelTool({target(0, 0)},300,0,0),v500\T:=2,fine,tGun;
        MoveL RelTool({target(0, 0, 150)},300,-150,-100),v1000,fine,tGun;
        PaintL {target(0, 150)},v500,fine,tGun;"""
    return (
        main,
        poses,
        'PERS tooldata tGun:=[TRUE,[[0,0,200],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];',
    )


def modules():
    """A program of three modules, two of which have a datum of the same name for themselves."""
    poses = Poses(0, 120).go(400, 120, 500, 1).go(400, 220, 700).go(0, 220, 500, 2)
    text = {
        'Main.mod': 'MODULE Main\nLOCAL CONST num y:=120;\nPROC main()\n'
        'MoveJ Offs(pOrigin,0,y,0),v500,fine,tGun;\nrUp y;\nrDown;\nENDPROC\nENDMODULE',
        'Strokes.mod': 'MODULE Strokes\nLOCAL VAR num y:=220;\nPROC rUp(num y)\nSetBrush 1;\n'
        'PaintL Offs(pOrigin,400,y,0),v500,z10,tGun;\nENDPROC\nPROC rDown()\n'
        'MoveL Offs(pOrigin,400,y,0),v700,z10,tGun;\nSetBrush 2;\n'
        'PaintL Offs(pOrigin,0,y,0),v500,fine,tGun;\nENDPROC\nENDMODULE',
        'Base.sys': f'MODULE Base(SYSMODULE)\nPERS robtarget pOrigin:={target(0, 0)};\nENDMODULE',
    }
    return text, poses


PROGRAMS = (
    zigzag, arrays, procedures, styles, planes, conveyor, outputs, tools, modules,
)  # fmt: skip


def written(content, folder, *declared):
    """A program of one module, or the folder of those of several."""
    if isinstance(content, dict):
        for name, text in content.items():
            (folder / name).write_text(text)
        listed = ''.join(f'<Module>{name}</Module>' for name in content)
        (folder / 'door.pgf').write_text(f'<?xml version="1.0"?><Program>{listed}</Program>')
        return folder / 'door.pgf'
    path = folder / 'paint.mod'
    declared = '\n'.join((f'CONST robtarget pOrigin:={target(0, 0)};', *declared))
    path.write_text(f'MODULE Paint\n{declared}\nPROC main()\n{content}\nENDPROC\nENDMODULE\n')
    return path


@pytest.mark.parametrize('program', PROGRAMS)
def test_a_paint_program_has_the_motion_that_it_means(program, tmp_path):
    content, poses, *declared = program()
    path = written(content, tmp_path, *declared)
    motions = [pd.read_recording(path)]
    if isinstance(content, dict):
        path.unlink()
        motions.append(pd.read_recording(tmp_path))
    wanted = sampled(poses.trajectory)
    for motion in motions:
        np.testing.assert_allclose(sampled(motion), wanted, rtol=0, atol=1e-8)


def sampled(motion):
    """(1000, 6) place [m], flow, and brush while it is open, over the time of a motion."""
    times = np.linspace(0.0, motion.duration_s, 1002)[1:-1] + 1e-7
    own = (motion.stamps_ns - motion.stamps_ns[0]) * 1e-9
    place = [np.interp(times, own, motion.positions_m[:, axis]) for axis in range(3)]
    now = np.searchsorted((motion.trigger_stamps_ns - motion.stamps_ns[0]) * 1e-9, times) - 1
    flow = motion.trigger_flow[now]
    return np.array([times, *place, flow, motion.trigger_brush[now] * (flow > 0.0)]).T
