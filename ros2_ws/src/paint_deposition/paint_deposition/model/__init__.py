"""Equations (1) to (5): pattern, projection, profile of a pass, evenness of parallel passes."""
