"""NARX models by orthogonal least squares."""
