MODULE Paint
CONST robtarget pOrigin:=[[0,0,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
PROC main()
    VAR num style:=3;
    VelSet 50,300;
    AccSet 80,80;
    TEST style
    CASE 1,2: rOther;
    CASE 3: rHood style;
    DEFAULT: Stop;
    ENDTEST
    PaintL [[0,0,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v10,fine,tGun;
ENDPROC
PROC rHood(num style)
    PDispSet [[0,60,0],[1,0,0,0]];
    MoveJ [[0,0,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,fine,tGun;
    SetBrush 2;
    PaintL [[500,0,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,z10,tGun;
    PaintL [[500,100,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v500,fine,tGun;
    IF style=3 AND NOT FALSE THEN EXIT; ENDIF
ENDPROC
PROC rOther()
    MoveL [[9,9,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v10,fine,tGun;
ENDPROC
ENDMODULE
