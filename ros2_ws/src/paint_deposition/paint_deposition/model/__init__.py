"""Eqs. (1) to (5) of Conner et al. (IROS 2002) in files of their names, and brushes."""
