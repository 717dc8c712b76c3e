"""The reference pages, made from the code; each module has one function ``text``."""
