"""The poses and signals of a robot's gun, published as `atomizer/pose` and `atomizer/state`."""
