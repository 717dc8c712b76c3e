"""A virtual paint shop, the independent opponent of the deposition model.

It shares no code with it, integrates another way (droplets that fly and land) and hides effects.
"""
