"""Texts to begin from: small files of each kind that show much of what it may hold."""

RAPID = rb"""MODULE Door
  PERS wobjdata wobjDoor:=[FALSE,TRUE,"",[[900,0,600],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  CONST robtarget p1:=[[0,0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  VAR robtarget p2;
  CONST speeddata vPaint:=[500,500,5000,1000];
  VAR triggdata gunOn;
  VAR num n{2}:=[1,2];
  PROC pass(num k)
    ConfL\Off;
  ENDPROC
  PROC main()
    TriggIO gunOn,0\Start\DOp:=doGun,1;
    SetAO aoFlow,1.1;
    p2:=Offs(p1,0,0,100*(1+2));
    p2.trans.x:=n{2}/4;
    MoveJ p1,vmax,z10,tBell\WObj:=wobjDoor;
    TriggL RelTool(p2,0,10,0),vPaint,gunOn,fine,tBell\WObj:=wobjDoor;
    MoveC p1,p2,v100\V:=200,z50,tBell;
    MoveLDO p1,v50,z1,tBell,doGun,0;
    MoveL p2,v200\T:=2,z0,tBell;
    SetBrush 3;
    PaintL p1,vPaint,fine,tBell;
    IF n{1}=2 THEN
      MoveAbsJ [[0,0,0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tBell;
    ENDIF
  ENDPROC
ENDMODULE
"""
READINGS = (
    b'x_m,y_m,z_m,thickness_um,point,sigma_um,group,nx,ny,nz\n'
    b'0.1,0,0.2,24.5,P1,0.5,a,0,-1,0\n0.2,0,0.2,25.5,P2,0.5,b,0,-1,0\n',
    b'Batch;7\nMessung;x [mm];y [mm];z [mm];Schichtdicke [\xc2\xb5m];1;2\n'
    b'1;100,5;0;200;24,5;24,1;25\n2;200;0;200;1.025,5;n/a;<5\n',
    b'point\tfrom_left\theight\tdft mils\nP1\t10\t20\t1.2\nP1\t10\t20\t1.3\n',
)
POSES = (
    b'time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw,spraying\n0,0,0,0,0,0,0,1,1\n0.1,10,0,0,0,0,0,1,0\n',
    b't;x [m];y [m];z [m];rx [deg];ry [deg];rz [deg]\n0;0;0;0;0;0;0\n0,1;0,01;0;0;0;0;90\n',
)
MODEL = b"""planar: {K1_cm3_per_s: 1.9, K2: 0.15, K3: 0.2, phi_rad: 0.6, r_m: 0.22,
  sigma1_m: 0.09, sigma2_m: 0.15}
projection: {model_plane_m: 0.30, emission_offset_m: 0.05, occlusion: false}
effects:
  - {id: air_drift, shift_down_m: 0.01}
  - {id: learned, covariate: time_s, low: 0.0, high: 60.0, kind: factor,
     learned: [0.05, 0.0, -0.03, -0.05]}
"""
CAMPAIGN = b"""experiments:
  - name: door
    mesh: door.stl
    trajectory: door_horizontal
    pose_topic: /atomizer/pose
    measurements: door.csv
    part_pose: [0, 0, 0, 0, 0, 0, 1]
    columns: {thickness: 4}
    unit: {position: mm}
model: model.yaml
"""
