"""How many Runge-Kutta steps a model needs between two samples."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flightid.errors import DataError, OptionError, SingularError
from flightid.models.state_space.model import StateSpaceModel

STEP_RADIUS = 0.25
"""Largest product of step and eigenvalue at the trim: relative errors near 0.25^4/120 = 3e-5."""
MAXIMUM_SUBSTEPS = 1000


def steps_per_sample(
    model: StateSpaceModel,
    sample_time_s: float,
    substeps: int | None,
    radius: float = STEP_RADIUS,
    at: Mapping[str, float] | None = None,
) -> int:
    """Runge-Kutta steps in a sample interval: those asked for, or enough for the fastest mode.

    Parameters
    ----------
    model : StateSpaceModel
        Its eigenvalues count.
    sample_time_s : float
        Time between samples, s.
    substeps : int or None
        Number of steps; None chooses it so that a step times the largest eigenvalue stays within
        `radius`.
    radius : float
        Largest product of step and eigenvalue.
    at : mapping of str to float, optional
        Where the eigenvalues are taken, instead of the trim.

    Returns
    -------
    int

    Raises
    ------
    OptionError
        A number of steps outside 1 to 1000.
    DataError
        The model is too fast for the samples.

    Example
    -------
    >>> from flightid.models import load_model
    >>> steps_per_sample(load_model("quadrotor_6dof"), 0.01, None)
    1
    """
    if substeps is not None:
        if substeps not in range(1, MAXIMUM_SUBSTEPS + 1):
            raise OptionError(
                "substeps has no meaning", found=substeps, needed=f"1 to {MAXIMUM_SUBSTEPS}"
            )
        return substeps
    try:
        fastest = float(np.max(np.abs(model.eigenvalues(at=at)), initial=0.0))
    except (DataError, SingularError):
        # The trim may be no point of the flight; the run itself judges whether the model has a
        # value where it goes.
        return 1
    needed = max(1, int(np.ceil(fastest * sample_time_s / radius - 1e-9)))
    if needed > MAXIMUM_SUBSTEPS:
        raise DataError(
            "the model is too fast for the sample time",
            found=f"an eigenvalue of {fastest:g} rad/s at a sample time of {sample_time_s:g} s",
            needed=f"at most {MAXIMUM_SUBSTEPS} steps in a sample interval",
            action="replace a mode that is over within a sample by its gain",
        )
    return needed
