MODULE Paint
CONST robtarget pOrigin:=[[0,0,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
PERS wobjdata wTurned:=[FALSE,TRUE,"",[[60,0,250],[1,0,0,0]],[[40,0,0],[0.7071067811865476,0,0,0.7071067811865476]]];
PROC main()
    MoveL [[0,0,0],[0,0.7071067811865476,-0.7071067811865476,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v500,fine,tGun\WObj:=wTurned;
    SetBrush 0;
    SetBrush 1\X:=100;
    SetBrush 2\X:=250;
    SetBrush 0\X:=400;
    PaintL [[600,0,0],[0,0.7071067811865476,-0.7071067811865476,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v500,fine,tGun\WObj:=wTurned;
ENDPROC
ENDMODULE
