MODULE Paint
CONST robtarget pOrigin:=[[0,0,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
PERS tooldata tGun:=[TRUE,[[0,0,200],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
PROC main()
    MoveJ [[0,0,550],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,fine,tool0;
    MoveL [[0,0,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,fine,tGun;
    SetBrush 1;
    PaintL RelTool([[0,0,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],300,0,0),v500\T:=2,fine,tGun;
    MoveL RelTool([[0,0,150],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],300,-150,-100),v1000,fine,tGun;
    PaintL [[0,150,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v500,fine,tGun;
ENDPROC
ENDMODULE
