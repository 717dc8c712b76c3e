"""Results on disk: films, plans, calibrations, comparisons and diagnoses."""
