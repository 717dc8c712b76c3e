MODULE Paint
CONST robtarget pOrigin:=[[0,0,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
PERS wobjdata wPart:=[FALSE,FALSE,"CNV1",[[9,9,9],[1,0,0,0]],[[0,80,0],[1,0,0,0]]];
PROC main()
    MoveAbsJ [[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,z50,tGun;
    MoveJ [[-900,900,900],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,z50,tGun;
    ActUnit CNV1;
    WaitWObj wPart\RelDist:=300;
    MoveL [[0,0,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,fine,tGun\WObj:=wPart;
    SetBrush 2;
    PaintL [[600,0,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v400,z10,tGun\WObj:=wPart;
    SetBrush 0;
    PaintL [[600,120,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,z10,tGun\WObj:=wPart;
    SetBrush 2;
    PaintL [[0,120,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v400,z10,tGun\WObj:=wPart;
    DropWObj wPart;
    MoveJ [[-900,900,900],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,z50,tGun;
    DeactUnit CNV1;
ENDPROC
ENDMODULE
