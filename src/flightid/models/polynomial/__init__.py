"""Polynomial models, ARX to Box-Jenkins."""
