"""Many cases and many parts: processes, sweeps, lines."""
