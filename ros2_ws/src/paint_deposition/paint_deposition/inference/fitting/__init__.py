"""Model parameters from readings: priors, least squares, calibration."""
