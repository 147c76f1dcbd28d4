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

from flightid.conditioning.smoothing import fourier_smooth
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.identification.regression.sampled_equations import StateMeasurements
from flightid.uncertainty.estimate import Estimate

Array = NDArray[np.float64]
DRAWS = 8
LIMIT = 0.5
"""Standard errors of bias above which a 95 % interval holds noticeably less."""
_QUARTER_RATE = 0.25


def state_noise(motions: Sequence[StateMeasurements]) -> list[Array]:
    """Standard deviation of the white noise of each state, by record.

    Biased where a sensor's filter has taken the noise from the upper half of the band: too small.
    """
    return [
        np.array(
            [
                fourier_smooth(
                    state, motion.sample_time_s, cutoff_hz=_QUARTER_RATE / motion.sample_time_s
                ).noise
                for state in motion.states
            ]
        )
        for motion in motions
    ]


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
