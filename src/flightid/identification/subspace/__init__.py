"""Innovations models by subspace methods, refined by prediction errors."""
