"""Index, speed and passes for an even film."""
