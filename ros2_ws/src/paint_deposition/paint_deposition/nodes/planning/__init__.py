"""The node that recommends an index and plans passes."""
