"""Handling qualities: criteria, charts, ratings."""
