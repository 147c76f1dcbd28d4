"""Predictions: any model driven by a record's inputs, beside what was measured."""
