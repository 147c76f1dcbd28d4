"""Studies: the only place that chains stages, from a study file to a report."""
