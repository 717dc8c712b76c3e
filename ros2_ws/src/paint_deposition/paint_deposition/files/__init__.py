"""Files that are read: recordings, robot programs, meshes, models, readings, campaigns."""
