"""Estimators of frequency responses."""
