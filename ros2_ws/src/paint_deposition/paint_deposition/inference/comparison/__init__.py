"""The model beside the readings: residuals, regions, profiles."""
