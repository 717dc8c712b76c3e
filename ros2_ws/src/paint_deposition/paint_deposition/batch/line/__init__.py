"""A line: many parts over days, what they have in common and what changes."""
