"""Whether inputs or the past still predict what a model leaves."""
