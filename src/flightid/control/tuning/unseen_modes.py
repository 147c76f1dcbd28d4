"""By how much modes outside the band may move a vehicle that tuning knows from its fit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.control.margins.hidden_modes import COARSEST, most_moved_db
from flightid.control.tuning.evidence import TuningEvidence

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def moved_of(evidence: TuningEvidence, output: str, input: str, omega_rad_s: Array) -> Array | None:
    """By how much a mode outside the band may move one response of the evidence, dB.

    Parameters
    ----------
    evidence : TuningEvidence
    output, input : str
    omega_rad_s : ndarray, shape (n_f,)

    Returns
    -------
    ndarray, shape (n_f,), or None
        None where nothing tells how far the model was from its data, or what its parameters make
        up for.
    """
    name = f"{output}/{input}"
    bound = evidence.errors.get(name)
    if bound is None or not evidence.corners:
        return None

    def slopes(omega: Array) -> Complex:
        """The corners over the estimate, less one."""
        known, *others = (
            each.select(outputs=[output], inputs=[input]).frequency_response(omega)[0, 0]
            for each in (evidence.estimate, *evidence.corners)
        )
        return np.array([each / known - 1.0 for each in others])

    measured = evidence.measured.get(name)
    coarsest = None if measured is None else COARSEST * float(measured.omega_rad_s[0])
    return most_moved_db(omega_rad_s, evidence.band_rad_s, bound, slopes, coarsest)
