"""The part to paint: its refined surface, and what a point on it is like."""
