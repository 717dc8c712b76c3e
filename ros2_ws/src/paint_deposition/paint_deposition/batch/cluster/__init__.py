"""Many cases at once: processes on this machine, or workers of a Dask scheduler."""
