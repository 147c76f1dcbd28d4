"""Stability and control derivatives, with and without dimensions."""
