"""Fits to responses and records together."""
