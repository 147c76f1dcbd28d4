"""Augmentation laws as data: a few numbers by axis, and the blocks that they stand for."""
