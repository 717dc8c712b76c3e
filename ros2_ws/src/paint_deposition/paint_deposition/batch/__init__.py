"""Many cases side by side: processes and sweeps."""
