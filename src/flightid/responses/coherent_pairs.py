"""Which responses of a set are worth fitting, and why the others are not."""

from __future__ import annotations

import numpy as np

from flightid.errors import OptionError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.responses.bands import coherent_band
from flightid.responses.pair import PairResponse
from flightid.responses.response import FrequencyResponse
from flightid.result import Result
from flightid.table import Cell, Column, Table

MINIMUM_DECADES = 0.3
"""An octave."""
DRIVING_DECADES = 0.2
"""Coherent decades from which an input counts in a fit to samples, which no band of it enters.

Of 400 idle inputs beside one that drives the widest band was 0.15; what drives slowly has less than
an octave above the lowest frequency of a record (0.22 and 0.29 in DaISy's evaporator).
"""


@dataclass(frozen=True)
class CoherentPair:
    """One response as the coherence test sees it.

    Attributes
    ----------
    name : str
        ``"output/input"``.
    band_rad_s : tuple of float or None
        Lowest and highest coherent frequency, rad/s; gaps may lie between.
    decades : float
        Width of all coherent frequencies together.
    highest : float
        Largest coherence anywhere.
    kept : bool
        Whether it is wide enough to fit.
    reason : str
        Why, in words.

    Example
    -------
    >>> CoherentPair("r/lon", None, 0.0, 0.2, False, "no response above the noise").kept
    False
    """

    name: str
    band_rad_s: tuple[float, float] | None
    decades: float
    highest: float
    kept: bool
    reason: str


@dataclass(frozen=True, repr=False)
class CoherentPairs(Result, schema="flightid.coherent_pairs/1"):
    """The coherence test of every response of a set.

    Attributes
    ----------
    pairs : tuple of CoherentPair
        One for each response.
    minimum_coherence, minimum_decades : float
        What was asked.
    findings : tuple of Finding
        None: to leave out a response that is not there is no fault.

    Example
    -------
    >>> import numpy as np
    >>> seen = FrequencyResponse.from_values(
    ...     np.geomspace(1, 10, 21), np.ones((1, 2, 21)), inputs=["a", "b"], outputs=["y"],
    ...     coherence=[[np.full(21, 0.9), np.full(21, 0.1)]])
    >>> coherent_pairs(seen)
    CoherentPairs(1 of 2 responses kept, coherence ≥ 0.6 over 0.3 decades)
    """

    pairs: tuple[CoherentPair, ...]
    minimum_coherence: float
    minimum_decades: float
    findings: tuple[Finding, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the responses that are kept, as `with_responses` of a model takes them."""
        return tuple(pair.name for pair in self.pairs if pair.kept)

    @property
    def bands(self) -> dict[str, tuple[float, float]]:
        """Band of each response that is kept, rad/s, as `flightid.identify` takes them."""
        return {
            pair.name: pair.band_rad_s
            for pair in self.pairs
            if pair.kept and pair.band_rad_s is not None
        }

    def summary(self) -> Table:
        """Table by response, with reasons."""
        columns = (
            Column("response"),
            Column("kept"),
            Column("from", "rad/s", 3),
            Column("to", "rad/s", 3),
            Column("coherent", "decades", 2),
            Column("highest coherence", digits=2),
            Column("reason"),
        )
        rows: list[tuple[Cell, ...]] = [
            (
                pair.name,
                "yes" if pair.kept else "no",
                *(pair.band_rad_s or (None, None)),
                pair.decades,
                pair.highest,
                pair.reason,
            )
            for pair in self.pairs
        ]
        return Table(repr(self), columns, tuple(rows))

    def __repr__(self) -> str:
        """How many are kept, on one line."""
        return (
            f"CoherentPairs({len(self.names)} of {len(self.pairs)} responses kept, "
            f"coherence ≥ {self.minimum_coherence:g} over {self.minimum_decades:g} decades)"
        )


def coherent_pairs(
    responses: FrequencyResponse,
    *,
    minimum_coherence: float = 0.6,
    minimum_decades: float = MINIMUM_DECADES,
) -> CoherentPairs:
    """Choose the responses that a fit should use, by their coherence.

    A response is kept where its coherent frequencies cover enough decades, gaps between them left
    out: near a lightly damped mode a pilot in the loop keeps the input small, and coherence dips
    in the middle of a good response.

    Parameters
    ----------
    responses : FrequencyResponse
        Measured responses of all outputs to all inputs; leakage is no coherence
        (`FrequencyResponse.shown`).
    minimum_coherence : float
        Coherence γ² from which a frequency counts, 0 to 1.
    minimum_decades : float
        Width that a response must have, decades; 0.3 is an octave.

    Raises
    ------
    OptionError
        An option outside its range.

    Reference
    ---------
    Tischler & Remple, Aircraft and Rotorcraft System Identification, 2nd ed., section 13.5.

    Example
    -------
    >>> import numpy as np
    >>> omega = np.geomspace(1, 10, 21)
    >>> seen = FrequencyResponse.from_values(
    ...     omega, np.ones((1, 1, 21)), inputs=["lat"], outputs=["p"],
    ...     coherence=np.where(omega < 5, 0.9, 0.2)[None, None])
    >>> coherent_pairs(seen).names
    ('p/lat',)
    """
    if not 0.0 < minimum_coherence < 1.0 or not minimum_decades > 0.0:
        raise OptionError(
            "the coherence test has no meaning",
            found=f"coherence {minimum_coherence}, decades {minimum_decades}",
            needed="a coherence between 0 and 1, and decades above 0",
        )
    known = responses.shown
    judged = tuple(
        _judged(known.pair(output, source), minimum_coherence, minimum_decades)
        for output in responses.outputs
        for source in responses.inputs
    )
    return CoherentPairs(judged, minimum_coherence, minimum_decades)


def _judged(pair: PairResponse, minimum: float, needed: float) -> CoherentPair:
    name, coherent = f"{pair.output}/{pair.input}", pair.coherence >= minimum
    highest = float(np.max(pair.coherence))
    band, decades = coherent_band(pair.omega_rad_s, pair.coherence, minimum)
    if band is None:
        reason = f"coherence reaches {highest:.2f} at most: no response above the noise"
        return CoherentPair(name, None, 0.0, highest, False, reason)
    if decades < needed:
        reason = f"coherent over {decades:.2f} decades only: too narrow to fit"
        return CoherentPair(name, band, decades, highest, False, reason)
    gaps = int(np.sum(np.diff(coherent.astype(np.int8)) == 1)) - (0 if coherent[0] else 1)
    reason = "coherent" if gaps == 0 else f"coherent but for {gaps} gap{'s' if gaps > 1 else ''}"
    return CoherentPair(name, band, decades, highest, True, reason)
