"""How far noise in the measured states moves equation error: noise is added once more and refitted.

Least squares with noise in its regressors is biased, mostly towards zero, and more data do not
help. To first order the bias grows with the variance of that noise, so the change that the same
amount of noise on top makes is the bias that is already there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.identification.records.white_noise import white_levels
from flightid.identification.regression.sampled_equations import StateMeasurements
from flightid.uncertainty.estimate import Estimate

Array = NDArray[np.float64]
DRAWS = 8
LIMIT = 0.5
"""Standard errors of bias above which a 95 % interval holds noticeably less."""


def state_noise(motions: Sequence[StateMeasurements]) -> list[Array]:
    """Standard deviation of the white noise of each state, by record."""
    return [white_levels(motion.states) for motion in motions]


def attenuation(
    motions: Sequence[StateMeasurements],
    refit: Callable[[Sequence[StateMeasurements]], Array],
    estimate: Array,
) -> Array:
    """Estimated bias of each free parameter by noise in the states.

    Parameters
    ----------
    motions : sequence of StateMeasurements
    refit : callable
        Estimates from motions with more noise.
    estimate : ndarray, shape (n_free,)
        From the motions as they are.

    Returns
    -------
    ndarray, shape (n_free,)

    Reference
    ---------
    Cook & Stefanski (1994), "Simulation-extrapolation estimation in parametric measurement error
    models", J. American Statistical Association 89, §2 (first step of the extrapolation).
    """
    levels = state_noise(motions)
    generator = np.random.default_rng(0)
    moved = np.zeros_like(estimate)
    for _ in range(DRAWS // 2):
        draws = [
            level[:, None] * generator.standard_normal(motion.states.shape)
            for level, motion in zip(levels, motions, strict=True)
        ]
        # With its negative, what is linear in the added noise cancels.
        for sign in (1.0, -1.0):
            noisier = [
                replace(motion, states=motion.states + sign * draw)
                for motion, draw in zip(motions, draws, strict=True)
            ]
            moved += refit(noisier) - estimate
    return moved / DRAWS


def noise_energy(
    motions: Sequence[StateMeasurements],
    residuals: Callable[[Sequence[StateMeasurements]], Sequence[Array]],
) -> Array:
    """Sum of squares that noise of the measurements makes of the residuals of each equation.

    `residuals` are those at the estimate, by record, from motions with more noise: what as much
    noise again changes in them is as large as what the noise that is there does.
    """
    before = residuals(motions)
    generator = np.random.default_rng(1)
    noisier = []
    for motion in motions:
        rows = np.vstack([motion.states, motion.others])
        draw = white_levels(rows)[:, None]
        draw = draw * generator.standard_normal(rows.shape)
        states, others = np.split(draw, [len(motion.states)])
        noisier.append(
            replace(motion, states=motion.states + states, others=motion.others + others)
        )
    pairs = zip(residuals(noisier), before, strict=True)
    return np.asarray(np.sum([np.sum((one - other) ** 2, axis=1) for one, other in pairs], axis=0))


def judge_attenuation(
    bias: Mapping[str, float], parameters: Mapping[str, Estimate]
) -> list[Finding]:
    """One verdict for each parameter that the noise in the states moves noticeably."""
    found = []
    for name, size in bias.items():
        known = parameters[name]
        if known.stderr and abs(size) > LIMIT * known.stderr:
            share = f" ({100.0 * size / known.value:+.2g} %)" if known.value else ""
            found.append(
                Finding(
                    "attenuation",
                    Light.AMBER,
                    f"{name}: noise in the measured states moves it by about {size:+.3g} "
                    f"{known.unit}{share}, {abs(size) / known.stderr:.1f} standard errors",
                    "use it as a start value; for the value itself method='output_error' or "
                    "'fourier_output_error', a narrower band, or smoother states",
                )
            )
    return found
