"""Film thickness of rotary bell spray painting: simulation, calibration, diagnosis."""
