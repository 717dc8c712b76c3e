MODULE Main
LOCAL CONST num y:=120;
PROC main()
MoveJ Offs(pOrigin,0,y,0),v500,fine,tGun;
rUp y;
rDown;
ENDPROC
ENDMODULE
