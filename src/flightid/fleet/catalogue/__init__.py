"""The catalogue: a small file a log, compacted into tables that SQL reads."""
