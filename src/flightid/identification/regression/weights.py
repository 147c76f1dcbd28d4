"""Weights from residuals: one deviation for each equation, or a smooth spectrum of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.identification.regression.rounds import Rows
from flightid.uncertainty.agreement import AgreementTest
from flightid.uncertainty.blocks import RecordBlock
from flightid.uncertainty.coloured_residuals import white_covariance
from flightid.uncertainty.spectral import averaged, spectral_covariance

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
_TINY = 1e-300


def level_weights(residuals: Sequence[Array]) -> list[Array]:
    """Inverse standard deviations, one for each equation, of all records together."""
    power = np.sum([np.sum(each**2, axis=1) for each in residuals], axis=0)
    deviation = np.sqrt(power / sum(each.shape[1] for each in residuals)) + _TINY
    return [np.ones(each.shape) / deviation[:, None] for each in residuals]


def spectral_weights(residuals: Sequence[Array], omegas: Sequence[Array]) -> list[Array]:
    """Inverse deviations from the residuals' spectrum, averaged over neighbouring harmonics.

    Parameters
    ----------
    residuals : sequence of ndarray, shape (n_equations, 2 n_f)
        Real parts, then imaginary parts, of each record.
    omegas : sequence of ndarray, shape (n_f,)
        Their frequencies, rad/s.

    Returns
    -------
    list of ndarray, shape (n_equations, 2 n_f)

    Reference
    ---------
    Brockwell & Davis, *Time Series: Theory and Methods*, 2nd ed., §10.4 (averaged periodogram).
    """
    order = np.argsort(np.concatenate(list(omegas)), kind="stable")
    power = 0.5 * np.abs(np.concatenate([_complex(each) for each in residuals], axis=1)) ** 2
    smooth = np.empty_like(power)
    smooth[:, order] = averaged(power[:, order])
    ends = np.cumsum([len(each) for each in omegas])[:-1]
    parts = np.split(np.sqrt(smooth) + _TINY, ends, axis=1)
    return [np.tile(1.0 / part, 2) for part in parts]


def fourier_covariance(
    rows: Sequence[Rows], weights: Sequence[Array], omegas: Sequence[Array]
) -> tuple[Array, float]:
    """Covariance and degrees of freedom, from the spectra of all records' residuals.

    Raises
    ------
    SingularError
        Some combination of the parameters has no influence.
    """
    order = np.argsort(np.concatenate(list(omegas)), kind="stable")
    pairs = list(zip(rows, weights, strict=True))
    residuals = np.concatenate([_complex(r.residuals * w) for r, w in pairs], axis=1)
    slopes = [_complex(np.moveaxis(r.slopes, 2, 1) * w[:, None]) for r, w in pairs]
    jacobian = np.moveaxis(np.concatenate(slopes, axis=2), 1, 2)
    return spectral_covariance(jacobian[:, order], residuals[:, order])


def compared_covariance(
    rows: Sequence[Rows], weights: Sequence[Array], omegas: Sequence[Array]
) -> AgreementTest:
    """`fourier_covariance`, records and halves of each compared.

    Halves are those of the weighted harmonics taken back in time, where white residuals are white.
    """
    covariance, freedom = fourier_covariance(rows, weights, omegas)
    blocks = []
    for each, weight in zip(rows, weights, strict=True):
        residual = _in_time(_complex(each.residuals * weight))
        slopes = _in_time(_complex(np.moveaxis(each.slopes, 2, 1) * weight[:, None]))
        sensitivity = -np.moveaxis(slopes, 1, 2)
        blocks.append(RecordBlock.of(sensitivity, np.zeros((residual.size, 0)), residual))
    return white_covariance(blocks, covariance, freedom, grown=True)


def _in_time(harmonics: Complex) -> Array:
    """Real sequence of neighbouring harmonics, which keeps the place in time of what they hold."""
    quiet = np.zeros((*harmonics.shape[:-1], 1))
    return np.fft.irfft(np.concatenate([quiet, harmonics, quiet], axis=-1), axis=-1)


def _complex(rows: Array) -> Complex:
    real, imaginary = np.split(rows, 2, axis=-1)
    return np.asarray(real + 1j * imaginary)
