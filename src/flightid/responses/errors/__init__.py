"""Covariance and random error of response estimates."""
