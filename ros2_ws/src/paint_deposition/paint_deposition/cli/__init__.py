"""The command line `paint`."""
