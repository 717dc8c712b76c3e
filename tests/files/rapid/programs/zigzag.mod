MODULE Paint
CONST robtarget pOrigin:=[[0,0,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
PROC main()
    VAR num y:=0; VAR robtarget a; VAR robtarget b;
    ConfL\Off;
    SetDO doFanOn,1;
    MoveL [[0,0,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v500,fine,tGun;
    SetBrush 1;
    FOR i FROM 0 TO 3 DO
        y:=i*100;
        IF i MOD 2=0 THEN
            a:=[[0,y,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];  b:=[[600,y,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
        ELSE
            a:=[[600,y,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];  b:=[[0,y,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
        ENDIF
        MoveL a,v500,fine,tGun;
        PaintL b,v600,z30,tGun;
    ENDFOR
    Reset doFanOn;
ENDPROC
ENDMODULE
