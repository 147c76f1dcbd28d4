"""Structures ranked on records they have not seen."""
