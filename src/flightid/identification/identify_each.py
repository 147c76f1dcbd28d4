"""The verb for many data sets of one structure: Monte Carlo, fleets, bootstraps."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from flightid.errors import FlightidError
from flightid.identification.fit import Fit
from flightid.identification.identify import Data, Structure, identify
from flightid.identification.shared_work import shared_work
from flightid.progress import track
from flightid.record.hold import Loop
from flightid.threads import on_one_thread


@on_one_thread
def identify_each(
    model: Structure,
    data_sets: Iterable[Data],
    *,
    method: str | None = None,
    loop: Loop | None = None,
    **options: Any,  # noqa: ANN401 - the method checks them
) -> tuple[Fit, ...]:
    """Fit one model to each of many data sets, all from the same start.

    Each fit is what `identify` makes of that data set alone, digit by digit. What they have in
    common is worked out once: the model's equations and, of responses with the same frequencies
    and coherences, as redrawn ones have, which points are fitted, their weights, their order, and
    the model's responses there at the starts.

    Parameters
    ----------
    model : GreyBoxModel, NarxStructure, PolynomialStructure or SubspaceStructure
        As `identify` takes it. From a fit's own model the searches are short.
    data_sets : iterable of FrequencyResponse, Record, sequence of Record, or tuple of both
        What `identify` takes as data, one after the other; they may be made as they are asked for.
    method, loop, **options
        As `identify` takes them.

    Returns
    -------
    tuple of Fit
        In the order of the data sets.

    Raises
    ------
    FlightidError
        What `identify` raises; a note of it says of which data set.

    Notes
    -----
    The scatter of the estimates is that of the data sets: of redrawn noise their random error, of
    a fleet its vehicles as well. A start at the first fit's values favours the minimum it found.

    Reference
    ---------
    Efron & Tibshirani, *An Introduction to the Bootstrap*, chapters 6 and 9.

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> truth = fid.load_model("rate_first_order").with_values({"Lp": -6.0, "Ltphi": 180.0})
    >>> omega = np.geomspace(1.0, 50.0, 100)
    >>> noise = np.random.default_rng(0).standard_normal((3, 2, 1, 1, 100))
    >>> drawn = [
    ...     fid.FrequencyResponse.from_values(
    ...         omega, truth.frequency_response(omega) * np.exp(0.02 * (a + 1j * b)),
    ...         inputs=["tau_phi"], outputs=["p"], units={"p": "rad/s"},
    ...         random_error=np.full(100, 0.02))
    ...     for a, b in noise]
    >>> fits = fid.identify_each(truth, drawn)
    >>> [round(fit.parameters["Lp"].value, 1) for fit in fits]
    [-6.0, -6.0, -6.0]
    """
    found = []
    with shared_work():
        for number, data in enumerate(track(data_sets, "fitting"), 1):
            try:
                found.append(identify(model, data, method=method, loop=loop, **options))
            except FlightidError as error:
                error.add_note(f"in data set {number}")
                raise
    return tuple(found)
