MODULE Paint
CONST robtarget pOrigin:=[[0,0,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
PROC main()
    VAR num n:=1; VAR robtarget p:=[[0,0,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    CONST num stroke{3,3}:=[[50,400,1],[130,500,2],[240,600,1]];
    WHILE n<=Dim(stroke,1) DO
        p.trans.x:=0;  p.trans.y:=stroke{n,1};
        MoveL p,v1000,fine,tGun;
        SetBrush stroke{n,3};
        p.trans.x:=p.trans.x+500;
        PaintL p,v50\V:=stroke{n,2},fine,tGun;
        Incr n;
    ENDWHILE
ENDPROC
ENDMODULE
