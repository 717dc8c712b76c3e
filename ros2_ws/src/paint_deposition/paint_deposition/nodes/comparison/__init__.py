"""The node that compares gauge readings with the film."""
