"""Controllers closed around models and opened again."""
