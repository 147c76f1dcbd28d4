"""Blackbox logs of Betaflight and its relatives."""
