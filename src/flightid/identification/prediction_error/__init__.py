"""Polynomial models by prediction errors."""
