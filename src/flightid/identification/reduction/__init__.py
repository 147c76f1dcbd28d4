"""Structures that the data determine."""
