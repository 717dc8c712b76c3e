"""What readings say of the model: readings, fit, comparison, diagnosis."""
