"""Gauge readings: noise, outliers, residuals, covariates, and the campaign that they belong to."""
