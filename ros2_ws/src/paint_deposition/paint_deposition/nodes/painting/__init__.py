"""The simulator, and what all nodes share that follow the atomizer."""
