"""The node that shows the cell on a page."""
