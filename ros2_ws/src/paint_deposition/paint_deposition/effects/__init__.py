"""Physics beyond eqs. (1) and (2), and the deposition model that they are composed into."""
