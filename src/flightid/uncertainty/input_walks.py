"""Random walks that noise of inputs makes of outputs, as a fit meets them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.uncertainty.blocks import RecordBlock
from flightid.uncertainty.fitted_directions import FittedDirections
from flightid.uncertainty.input_noise import InputNoise
from flightid.uncertainty.periodograms import periodogram

Array = NDArray[np.float64]
DRAWS = 32
"""Draws of random walks."""


def left_of_walks(taken: FittedDirections, noise: InputNoise, whitener: Array) -> Array:
    """Mean periodogram of what a fit leaves of each output's random walk.

    Draws come from a fixed seed: the same record gives the same intervals.
    """
    directions = taken.shared
    n = directions.shape[1]
    draws = np.random.default_rng(0).standard_normal((n - 1, noise.steps.shape[2], DRAWS))
    walks = noise.outputs_of(draws) * whitener[:, None, None]
    along = np.einsum("onp,ond->pd", directions, walks, optimize=True)
    return np.array([periodogram(walk) for walk in walks - directions @ along])


def gradients_of_walks(block: RecordBlock, noise: InputNoise, whitener: Array) -> Array:
    """Gradients that unit noise of each input and step makes, shape (n_noises, n)."""
    sensitivities = block.projected.reshape(*block.residual.shape, -1)
    paths = noise.transposed(sensitivities * whitener[:, None, None])
    return np.asarray(paths.reshape(-1, paths.shape[2]))
