"""How each kind of result is written."""
