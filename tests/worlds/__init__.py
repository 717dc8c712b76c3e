"""Worlds in which campaigns are painted to judge a diagnosis; none shares a law with another.

`semi_real` paints with measured footprints, remainders and noise, `jet` with drops in an air jet.
Neither imports the package or the droplet shop's laws. `record` is what both hand over.
"""
