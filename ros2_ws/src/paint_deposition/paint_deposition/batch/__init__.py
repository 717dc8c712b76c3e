"""Many cases and many parts: workers, sweeps, lines."""
