"""The integral of flux over the way: the film at every point, and its statistics."""
