"""The live page: what it shows, and the server that brings it to browsers."""
