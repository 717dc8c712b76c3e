"""Worlds in which campaigns are painted to judge a diagnosis.

`droplets` are those of the virtual paint shop; `semi_real` paints with measured footprints,
remainders and noise, and shares no law with it or the package. `record` is what both hand over.
"""
