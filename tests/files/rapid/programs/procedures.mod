MODULE Paint
CONST robtarget pOrigin:=[[0,0,250],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
PROC main()
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
    SearchL di,p,p,v1,tGun;
ENDPROC
ENDMODULE
