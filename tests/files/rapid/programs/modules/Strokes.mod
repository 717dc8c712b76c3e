MODULE Strokes
LOCAL VAR num y:=220;
PROC rUp(num y)
SetBrush 1;
PaintL Offs(pOrigin,400,y,0),v500,z10,tGun;
ENDPROC
PROC rDown()
MoveL Offs(pOrigin,400,y,0),v700,z10,tGun;
SetBrush 2;
PaintL Offs(pOrigin,0,y,0),v500,fine,tGun;
ENDPROC
ENDMODULE
