"""The film: its integrator, live and offline, its statistics, and how the gun ran."""
