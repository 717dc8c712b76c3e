"""Tool paths: recorded poses, and the sub-steps that the film is integrated over."""
