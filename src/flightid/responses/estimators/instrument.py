"""Closed loops: the excitation as instrument (joint input–output estimate).

Output noise that a loop feeds back to the input is correlated with the input but not with the
excitation. The part of the input that follows from the excitation takes the input's place.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.responses.estimators.conditioned import (
    ConditionalSpectra,
    assemble,
    invert_inputs,
    random_error,
)
from flightid.responses.spectra import Spectra
from flightid.responses.windows.samples import Samples

WEAK = 10.0
"""F below which an instrument is weak: its estimate lies nearer to the direct one than to truth."""


def excitation_projection(spectra: Spectra, samples: Samples) -> NDArray[np.complex128]:
    """``G_ur G_rr⁻¹``, shape (n_f, n_in, n_exc): what excitations make of the inputs."""
    exc, inputs = samples.rows("excitations"), samples.rows("inputs")
    rr, ru = spectra.matrix[:, exc, exc], spectra.matrix[:, exc, inputs]
    return np.asarray(np.linalg.solve(rr, ru).conj().transpose(0, 2, 1))


def condition_on_excitation(
    spectra: Spectra, n_inputs: int, n_outputs: int, omega: NDArray[np.float64], samples: Samples
) -> ConditionalSpectra:
    """Responses ``H = [G_ũũ⁻¹ G_ũy]ᵀ`` with ũ the part of the inputs that follows the excitations.

    With one excitation and one input this is ``G_ry / G_ru``. Coherence and random error are those
    of the excited part of the input against the noise ``y − H u``; where the excitations are weak
    instruments the coherence is at most their own share of the input. Beyond the last frequency of
    a sweep nothing but feedback is left: H tends to the inverse of the controller, which leaves no
    noise at all and would be coherent.

    Raises
    ------
    DataError
        Fewer excitations than inputs, an excitation without power, or inputs that the excitations
        do not tell apart.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., section 13.5 (joint input–output approach); Pintelon &
    Schoukens, 2nd ed., section 2.6.4. Weak instruments: Staiger & Stock, *Econometrica* 65 (1997),
    557–586; each of several inputs: Sanderson & Windmeijer, *J. Econometrics* 190 (2016), 212–221.
    """
    if len(samples.excitations) < n_inputs:
        raise DataError(
            "there are fewer excitations than inputs",
            found=f"{', '.join(samples.excitations)} for {', '.join(samples.inputs)}",
            needed="one independent excitation for each input",
            action="estimate one input at a time, or excite every loop",
        )
    matrix = spectra.matrix
    inputs = slice(0, n_inputs)
    outputs = slice(n_inputs, n_inputs + n_outputs)
    exc = samples.rows("excitations")
    invert_inputs(matrix[:, exc, exc], omega, samples.excitations)
    onto = excitation_projection(spectra, samples)
    excited = onto @ matrix[:, exc, inputs]
    cross = onto @ matrix[:, exc, outputs]
    inverse = invert_inputs(excited, omega, samples.inputs)
    h = inverse @ cross
    explained = np.real(np.sum(np.conj(cross) * h, axis=1))
    uu, uy = matrix[:, inputs, inputs], matrix[:, inputs, outputs]
    yy = np.real(np.einsum("fii->fi", matrix))[:, outputs]
    # Spectrum of y − H u, conjugate on the first factor.
    both = np.real(np.sum(np.conj(h) * uy, axis=1))
    fed = np.real(np.sum(np.conj(h) * (uu @ h), axis=1))
    residual = np.clip(yy - 2.0 * both + fed, 0.0, None)
    found = assemble(h, inverse, explained, residual, spectra)
    return _bounded(found, excited_share(inverse, uu), spectra)


def excited_share(
    excited_inverse: NDArray[np.complex128], inputs: NDArray[np.complex128]
) -> NDArray[np.float64]:
    """Share of each input, the others taken out, that follows the excitations, (n_in, n_f).

    Parameters
    ----------
    excited_inverse : ndarray of complex, shape (n_f, n_in, n_in)
        Inverse spectra of what follows the excitations.
    inputs : ndarray of complex, shape (n_f, n_in, n_in)
        Spectra of the inputs.
    """
    alone = 1.0 / np.real(np.einsum("fii->if", excited_inverse))
    whole = 1.0 / np.real(np.einsum("fii->if", np.linalg.pinv(inputs, hermitian=True)))
    return np.asarray(np.clip(alone / whole, np.finfo(float).eps, 1.0))


def _bounded(
    found: ConditionalSpectra, share: NDArray[np.float64], spectra: Spectra
) -> ConditionalSpectra:
    """With a coherence that is no larger than the share of an input by a weak instrument."""
    freedom = max(found.n_independent - 1.0, 0.0)
    weak = freedom * share < WEAK * (1.0 - share)
    most = np.broadcast_to(np.where(weak, share, 1.0), found.response.shape)
    explained = found.input_auto * np.abs(found.response) ** 2
    coherence = np.minimum(found.coherence, most)
    return replace(
        found,
        output_auto=np.maximum(found.output_auto, explained / most),
        random_error=random_error(coherence, found.n_independent, spectra.plan.shifts),
    )
