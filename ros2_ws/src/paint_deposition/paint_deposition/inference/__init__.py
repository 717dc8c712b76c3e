"""From gauge readings to a model: calibration, comparison, diagnosis, recommendation."""
