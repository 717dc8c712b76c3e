"""The effects that come with the project, one law a file."""
