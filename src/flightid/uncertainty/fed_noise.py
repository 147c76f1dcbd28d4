"""Noise of the outputs that a loop brings to the inputs: how much of it, at each frequency."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.uncertainty.feedback import usable_order
from flightid.uncertainty.feedback_result import LAGS, LEVEL
from flightid.uncertainty.lagged_products import past

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
LARGEST_ORDER = 40
"""Past samples of every channel: noise is strongest where the band is lowest."""
RANK = 1e-11
"""Share of the largest product below which a combination of past samples is rounding."""


def fed_noise_spectrum(
    inputs: Sequence[Array],
    outputs: Sequence[Array],
    sample_time_s: float,
    omega_rad_s: Array,
    at_once: Array | None = None,
) -> Complex | None:
    """Cross-spectrum of the inputs with the noise of the outputs, which an open loop leaves zero.

    A long ARX model tells the noise of the outputs and what is new in it; what of an input its own
    past and that news explain is the way back. Ways that chance explains are left out.

    Parameters
    ----------
    inputs, outputs : sequence of ndarray, shapes (n_in, n) and (n_out, n)
        Of each record, means removed.
    sample_time_s : float
    omega_rad_s : ndarray, shape (n_f,)
    at_once : ndarray, shape (n_out, n_in), optional
        What a sample of an input adds to outputs of the same sample; default: nothing. Records
        cannot tell it from a controller that answers within the sample, a model can.

    Returns
    -------
    ndarray of complex, shape (n_f, n_in, n_out), or None
        One-sided, per Hz, conjugate on the input. None where records are too short.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., section 13.4, equation 13.54: the bias of a direct
    estimate is the noise model's error times this spectrum over that of the inputs.
    """
    n_in, n_out = len(inputs[0]), len(outputs[0])
    if at_once is not None:
        outputs = [y - at_once @ u for u, y in zip(inputs, outputs, strict=True)]
    order = min(LARGEST_ORDER, usable_order(inputs, n_out))
    pairs = [
        (u, y) for u, y in zip(inputs, outputs, strict=True) if u.shape[1] > 2 * (order + LAGS)
    ]
    if order < 1 or not pairs:
        return None
    own = range(1, order + 1)
    known = [np.hstack([past(y, order, own), past(u, order, own)]) for u, y in pairs]
    model, news, _ = _least_squares(known, [y[:, order:].T for _, y in pairs])
    joined = np.vstack(news)
    covariance = joined.T @ joined / max(len(joined) - len(model), 1)
    # Inputs from their past and that of the outputs that move them; then both from news alone.
    fed = _fed(pairs, news, order)
    memory, back = np.zeros((order, n_in, n_in)), np.zeros((order + 1, n_out, n_in))
    past_inputs = [past(u, order, own) for u, _ in pairs]
    for i, outs in enumerate(fed):
        known = [
            np.hstack([mine, past(y[outs], order, range(order + 1))])
            for mine, (_, y) in zip(past_inputs, pairs, strict=True)
        ]
        way, *_ = _least_squares(known, [u[i : i + 1, order:].T for u, _ in pairs])
        memory[..., i] = way[: order * n_in, 0].reshape(order, n_in)
        back[:, outs, i] = way[order * n_in :, 0].reshape(order + 1, len(outs))
    turns = np.exp(-1j * sample_time_s * np.multiply.outer(omega_rad_s, np.arange(order + 1)))
    noise = np.linalg.inv(
        np.eye(n_out) - _at(model[: order * n_out].reshape(order, n_out, n_out), turns[:, 1:])
    )
    response = noise @ _at(model[order * n_out :].reshape(order, n_in, n_out), turns[:, 1:])
    controller = _at(back, turns)
    loop = np.eye(n_in) - _at(memory, turns[:, 1:]) - controller @ response
    reached = np.linalg.solve(loop, controller @ noise)
    spectrum = reached.conj() @ covariance @ noise.transpose(0, 2, 1)
    return np.asarray(2.0 * sample_time_s * spectrum)


def _fed(
    pairs: Sequence[tuple[Array, Array]], news: Sequence[Array], order: int
) -> list[list[int]]:
    """Of each input, the outputs whose news move it by more than chance explains."""
    first, own = order + LAGS, range(1, order + 1)
    n_in, n_out = len(pairs[0][0]), news[0].shape[1]
    known = [
        np.hstack([past(u, first, own), past(e.T, LAGS, range(LAGS + 1))])
        for (u, _), e in zip(pairs, news, strict=True)
    ]
    way, rest, inverse = _least_squares(known, [u[:, first:].T for u, _ in pairs])
    left = np.vstack(rest)
    found: list[list[int]] = [[] for _ in range(n_in)]
    for i, o in product(range(n_in), range(n_out)):
        places = order * n_in + o + n_out * np.arange(LAGS + 1)
        spread = inverse[np.ix_(places, places)] * float(left[:, i] @ left[:, i])
        spread /= max(len(left) - len(way), 1)
        height = float(way[places, i] @ np.linalg.pinv(spread, hermitian=True) @ way[places, i])
        if scipy.special.chdtrc(LAGS + 1, height) < LEVEL / (n_in * n_out):
            found[i].append(o)
    return found


def _at(lags: Array, turns: Complex) -> Complex:
    """Matrices at each frequency, from coefficients of lags, (n_lags, from, to)."""
    return np.asarray(np.einsum("fk,kab->fba", turns, lags))


def _least_squares(
    known: Sequence[Array], targets: Sequence[Array]
) -> tuple[Array, list[Array], Array]:
    """Coefficients (n_known, n_targets), residuals of each record, inverse of the products."""
    columns = np.vstack(known)
    sizes = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    scaled = columns / sizes
    inverse = np.linalg.pinv(scaled.T @ scaled, rcond=RANK, hermitian=True)
    inverse /= np.outer(sizes, sizes)
    found = inverse @ (columns.T @ np.vstack(targets))
    left = [y - x @ found for x, y in zip(known, targets, strict=True)]
    return found, left, inverse
