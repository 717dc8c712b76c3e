"""The node that replays recordings."""
