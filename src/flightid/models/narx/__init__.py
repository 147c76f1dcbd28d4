"""Nonlinear autoregressive models with products and radial functions."""
