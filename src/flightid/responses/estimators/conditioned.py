"""Conditioning: responses, coherences and random errors with the other inputs taken out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.responses.spectra import Spectra
from flightid.responses.windows.defaults import overlap_factor

WORST_CONDITION = 1e12
"""Condition number of the normalised input spectra beyond which the inputs cannot be told apart."""
SMALLEST_COHERENCE = 1e-12


@dataclass(frozen=True)
class ConditionalSpectra:
    """Spectra of each (output, input) pair with the other inputs' share removed.

    Attributes
    ----------
    response : ndarray of complex, shape (n_out, n_in, n_f)
    input_auto, output_auto : ndarray, shape (n_out, n_in, n_f)
        Conditioned auto-spectra; the input's is the same for every output.
    multiple : ndarray, shape (n_out, n_f)
        Multiple coherence.
    residual : ndarray, shape (n_out, n_f)
        Output spectrum that no input explains.
    inverse : ndarray of complex, shape (n_f, n_in, n_in)
        Inverse of the (explained) input spectra.
    random_error : ndarray, shape (n_out, n_in, n_f)
    n_independent : float
    """

    response: NDArray[np.complex128]
    input_auto: NDArray[np.float64]
    output_auto: NDArray[np.float64]
    multiple: NDArray[np.float64]
    residual: NDArray[np.float64]
    inverse: NDArray[np.complex128]
    random_error: NDArray[np.float64]
    n_independent: float

    @property
    def coherence(self) -> NDArray[np.float64]:
        """Partial coherence, shape (n_out, n_in, n_f)."""
        explained = self.input_auto * np.abs(self.response) ** 2
        return np.asarray(explained / np.maximum(self.output_auto, np.finfo(float).tiny))

    @property
    def cross(self) -> NDArray[np.complex128]:
        """Conditioned cross-spectrum, shape (n_out, n_in, n_f)."""
        return self.response * self.input_auto


def invert_inputs(
    spectra: NDArray[np.complex128], omega: NDArray[np.float64], names: tuple[str, ...]
) -> NDArray[np.complex128]:
    """Inverse of the input spectral matrix at each frequency, after scaling to unit diagonal.

    Raises
    ------
    DataError
        An input has no power at a frequency, or two inputs cannot be told apart there.
    """
    auto = np.real(np.einsum("fii->fi", spectra))
    dead = np.argwhere(auto <= 0.0)
    if dead.size:
        frequency, channel = dead[0]
        raise DataError(
            f"input {names[channel]!r} has no power",
            found=f"a zero auto-spectrum at {omega[frequency]:.4g} rad/s",
            needed="an input that moves in the band",
            action="leave it out of inputs, or narrow omega_rad_s",
        )
    scale = 1.0 / np.sqrt(auto)
    normal = spectra * scale[:, :, None] * scale[:, None, :]
    condition = np.linalg.cond(normal)
    worst = int(np.argmax(condition))
    if not condition[worst] < WORST_CONDITION:
        raise DataError(
            f"inputs {', '.join(names)} cannot be told apart",
            found=f"condition number {condition[worst]:.2g} at {omega[worst]:.4g} rad/s",
            needed=f"below {WORST_CONDITION:.0g}: more windows than inputs, and no input that "
            "follows from the others",
            action="add records, shorten the windows or leave out an input",
        )
    return np.asarray(np.linalg.inv(normal) * scale[:, :, None] * scale[:, None, :])


def random_error(
    coherence: NDArray[np.float64], n_independent: float | NDArray[np.float64], shifts: int
) -> NDArray[np.float64]:
    """Normalised random error of a response magnitude, 1 σ; 1 σ of phase in rad is the same number.

    Parameters
    ----------
    coherence : ndarray
        (Partial) coherence γ².
    n_independent : float or ndarray
        Independent windows n_d, less one for each input that is conditioned out.
    shifts : int
        Hops in a window; decides the factor for overlap.

    Returns
    -------
    ndarray
        ``C √(1 − γ²) / (|γ| √(2 n_d))``.

    Reference
    ---------
    Bendat & Piersol, *Engineering Applications of Correlation and Spectral Analysis*, 2nd ed.,
    table 11.3; Tischler & Remple, 2nd ed., equation 7.50.

    Example
    -------
    >>> random_error(np.array([0.6, 0.8]), 5, 2).round(5)
    array([0.19149, 0.11726])
    """
    gamma2 = np.clip(coherence, SMALLEST_COHERENCE, 1.0)
    error = overlap_factor(shifts) * np.sqrt((1.0 - gamma2) / (2.0 * n_independent * gamma2))
    return np.asarray(error)


def coherence_of(
    random_error: NDArray[np.float64], n_independent: float | NDArray[np.float64], shifts: int
) -> NDArray[np.float64]:
    """Coherence that gives a random error by so many windows: `random_error` solved for γ².

    Example
    -------
    >>> coherence_of(random_error(np.array([0.6, 0.8]), 5, 2), 5, 2).round(5)
    array([0.6, 0.8])
    """
    relative = np.asarray(random_error) / overlap_factor(shifts)
    return np.asarray(1.0 / (1.0 + 2.0 * n_independent * relative**2))


def condition(
    spectra: Spectra, n_inputs: int, omega: NDArray[np.float64], names: tuple[str, ...]
) -> ConditionalSpectra:
    """Condition the outputs on the inputs: ``H = [G_uu⁻¹ G_uy]ᵀ`` at each frequency.

    Parameters
    ----------
    spectra : Spectra
        Inputs first, then outputs.
    n_inputs : int
    omega : ndarray, shape (n_f,)
        Frequencies, rad/s, for messages.
    names : tuple of str
        Names of the inputs, for messages.

    Raises
    ------
    DataError
        An input without power, inputs that cannot be told apart, or too few windows.

    Reference
    ---------
    Bendat & Piersol, 2nd ed., chapter 10; Tischler & Remple, 2nd ed., chapter 9.
    """
    matrix = spectra.matrix
    uu, uy = matrix[:, :n_inputs, :n_inputs], matrix[:, :n_inputs, n_inputs:]
    yy = np.real(np.einsum("fii->fi", matrix))[:, n_inputs:]
    inverse = invert_inputs(uu, omega, names)
    h = inverse @ uy
    explained = np.real(np.sum(np.conj(uy) * h, axis=1))
    residual = np.clip(yy - explained, 0.0, None)
    return assemble(h, inverse, explained, residual, spectra)


def assemble(
    h: NDArray[np.complex128],
    inverse: NDArray[np.complex128],
    explained: NDArray[np.float64],
    residual: NDArray[np.float64],
    spectra: Spectra,
) -> ConditionalSpectra:
    """Conditioned spectra from the responses, the inverse input spectra and what is left.

    The Schur complement of an input is the reciprocal of its place on the inverse's diagonal, and
    the conditioned output is the residual plus what this one input adds.

    Parameters
    ----------
    h : ndarray of complex, shape (n_f, n_in, n_out)
    inverse : ndarray of complex, shape (n_f, n_in, n_in)
    explained, residual : ndarray, shape (n_f, n_out)
        Output spectra that the inputs explain, and what they leave.
    spectra : Spectra
        For the number of windows.
    """
    response = np.ascontiguousarray(h.transpose(2, 1, 0))
    alone = 1.0 / np.real(np.einsum("fii->if", inverse))
    left = np.ascontiguousarray(residual.T)
    input_auto = np.broadcast_to(alone, response.shape)
    output_auto = left[:, None, :] + input_auto * np.abs(response) ** 2
    n_inputs = inverse.shape[1]
    n_effective = spectra.n_independent - (n_inputs - 1)
    if n_effective < 1.0:
        raise DataError(
            "too few independent windows to take the other inputs out",
            found=f"{spectra.n_independent:.3g} windows of {spectra.plan.length} samples",
            needed=f"at least {n_inputs} for {n_inputs} inputs",
            action="add records or shorten the windows",
        )
    coherence = input_auto * np.abs(response) ** 2 / np.maximum(output_auto, np.finfo(float).tiny)
    total = explained.T + left
    return ConditionalSpectra(
        response,
        np.array(input_auto),
        output_auto,
        explained.T / np.maximum(total, np.finfo(float).tiny),
        left,
        inverse,
        random_error(coherence, n_effective, spectra.plan.shifts),
        n_effective,
    )
