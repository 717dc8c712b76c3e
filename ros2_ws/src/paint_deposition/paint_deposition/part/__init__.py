"""The part to paint: its refined surface and what a point of it sees."""
