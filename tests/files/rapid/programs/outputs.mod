MODULE Paint
CONST robtarget pOrigin:=[[0,0,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
VAR triggdata on; VAR triggdata off;
PROC main()
    TriggIO on,100\Start\DOp:=doGun,1;
    TriggIO off,50\DOp:=doGun,0;
    SetDO doGun,0;
    SetAO aoFlow,0.8;
    SetGO goBrush,1;
    MoveJ [[0,100,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v500,fine,tGun;
    TriggL [[500,100,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v500,on\T2:=off,fine,tGun;
    MoveL [[500,300,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v500,fine,tGun;
    SetAO aoFlow,1;
    SetGO goBrush,2;
    Set doGun;
    WaitTime \InPos,0.4;
    MoveL [[0,300,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v500,fine,tGun;
    Reset doGun;
ENDPROC
ENDMODULE
