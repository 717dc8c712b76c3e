"""Speeds, flows and triggers along a given path for a more even film."""
