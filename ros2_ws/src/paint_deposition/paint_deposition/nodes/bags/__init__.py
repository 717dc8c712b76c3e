"""The nodes that record bags and replay them."""
