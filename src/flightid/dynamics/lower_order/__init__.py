"""Equivalent systems of low order."""
