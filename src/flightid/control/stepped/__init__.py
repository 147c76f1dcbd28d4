"""Controllers that are stepped beside a model, for a pilot who flies it in real time."""
