"""Stability margins and disturbance rejection of loops."""
