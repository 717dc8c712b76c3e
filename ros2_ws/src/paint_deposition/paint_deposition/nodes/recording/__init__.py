"""The node that records runs."""
