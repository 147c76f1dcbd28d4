"""Output error: the model runs free through the records."""
