"""Gains that hold for every vehicle the data allow."""
