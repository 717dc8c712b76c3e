"""A virtual paint shop: painted parts whose film comes from traced paint parcels.

It is the independent opponent of the deposition model: it shares no code with it, integrates
another way (droplets that fly and land instead of a flux formula at the surface) and can hide one
physical effect in the data, so that a diagnosis can be judged without an inverse crime.
"""
