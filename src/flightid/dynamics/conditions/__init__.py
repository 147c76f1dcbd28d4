"""One vehicle at several flight conditions."""
