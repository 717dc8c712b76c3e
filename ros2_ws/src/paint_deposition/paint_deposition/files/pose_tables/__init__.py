"""Tables of poses, as robots, loggers and the project's own plans write them."""
