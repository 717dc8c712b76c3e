"""Pictures and reports of films, residuals and recommendations."""
