"""Physics beyond the plain pattern, one file an effect."""
