"""The node that sets gauge readings against the film."""
