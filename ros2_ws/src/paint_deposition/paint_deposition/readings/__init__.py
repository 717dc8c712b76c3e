"""Gauge readings: noise, outliers, covariates, and the campaign that they belong to."""
