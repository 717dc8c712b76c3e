"""A sweep: many variations of one job, each computed as `simulate` or `compare` would."""
