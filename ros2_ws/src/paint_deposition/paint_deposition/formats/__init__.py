"""Files in and out: recordings, meshes, tables, models, campaigns, robot programs."""
