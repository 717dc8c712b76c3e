"""Laws learned from readings: their form is no formula but values at knots."""
