"""What a robot tells of its gun, for those who follow `atomizer/pose` and `atomizer/state`."""
