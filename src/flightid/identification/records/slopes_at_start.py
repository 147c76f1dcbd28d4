"""Refuse a start at which an output has no slope, such as an airspeed at rest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.errors import FitError
from flightid.identification.records.setup import OwnNumbers

Array = NDArray[np.float64]


def require_slopes(
    slopes: Array, own: OwnNumbers, states: Sequence[str], outputs: Sequence[str], begin: int = 0
) -> None:
    """Refuse slopes that are not finite, with the states and outputs that they belong to.

    Parameters
    ----------
    slopes : ndarray, shape (n_outputs, n_samples, columns)
        By parameters, then by free initial states, input shifts and biases of the record.
    own : OwnNumbers
        Where the record begins.
    states, outputs : sequence of str
    begin : int
        Column of the first initial state.

    Raises
    ------
    FitError

    Example
    -------
    >>> none = np.zeros(0)
    >>> own = OwnNumbers(np.zeros(1), none, none, [0], [], [])
    >>> require_slopes(np.ones((1, 3, 1)), own, ["u"], ["V"])
    """
    whole = np.isfinite(slopes)
    if np.all(whole):
        return
    seen = [outputs[int(row)] for row in np.flatnonzero(~np.all(whole, axis=(1, 2)))]
    bad = ~np.all(whole, axis=(0, 1))[begin : begin + len(own.free_initial)]
    places = [k for k, lost in zip(own.free_initial, bad, strict=True) if lost]
    named = [states[k] for k in places or range(len(states))]
    at = ", ".join(f"{states[k]} = {own.initial[k]:g}" for k in places or range(len(states)))
    raise FitError(
        "an output has no finite slope where a run begins",
        found=f"{', '.join(seen)} by {', '.join(named)} at {at}",
        needed="a start at which every output can be differentiated by every state",
        action=f"declare [initial] of {named[0]} in the model near its true value "
        f"(.initial({named[0]!r}, VALUE) of a builder), or give "
        f"initial_state={{{named[0]!r}: VALUE}}",
    )
