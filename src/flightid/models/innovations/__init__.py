"""State-space models in innovations form."""
