"""Sweeps: many cases, by Dask or any other executor."""
