"""What leaves the bell and how it lands: pattern, projection, and a pass collapsed to a line."""
