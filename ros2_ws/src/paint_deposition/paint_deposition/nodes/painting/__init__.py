"""The simulator, and the base of all nodes that paint."""
