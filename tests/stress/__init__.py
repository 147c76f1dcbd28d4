"""Random structures, records and options: every end is a result or a typed error."""
