"""Which points of a measured response a fit uses, and with what weight."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.errors import DataError, OptionError, UnknownNameError
from flightid.frozen import dataclass
from flightid.identification.frequency_domain.options import Band, Bands
from flightid.identification.frequency_domain.steady_coherence import steady_coherence
from flightid.identification.shared_work import shared
from flightid.responses import FrequencyResponse, PairResponse
from flightid.responses.bands import coherent_band, nearest, usable_band
from flightid.responses.excited_band import injected_from, injected_to

COST_POINTS = 20.0
"""The cost is scaled as if 20 frequencies were fitted, whatever their number."""
MINIMUM_POINTS = 3
_EDGE = 1e-9
BY_EXCITATION = "instrument"
"""How estimates by way of a logged excitation begin their name."""
COHERENT_ALONE = (
    'fit the coherent responses alone: responses = "coherent" in a study, '
    "model.with_responses(*flightid.coherent_pairs(response).names) in Python"
)


def coherence_weight(coherence: ArrayLike) -> NDArray[np.float64]:
    """Weight of a point by its coherence, W_γ = [1.58 (1 − exp(−γ²))]².

    Parameters
    ----------
    coherence : array_like
        Coherence γ², 0 to 1.

    Returns
    -------
    ndarray
        Same shape; 0.51 at γ² = 0.6, 1.0 at γ² = 1.

    Reference
    ---------
    Tischler & Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., eq. 11.5. The
    exponent is γ², not its square.

    Example
    -------
    >>> coherence_weight([0.6, 1.0]).round(5)
    array([0.50819, 0.9975 ])
    """
    return np.asarray((1.58 * (1.0 - np.exp(-np.asarray(coherence, dtype=np.float64)))) ** 2)


@dataclass(frozen=True)
class SelectedResponse:
    """Points of one measured response that a fit uses.

    Attributes
    ----------
    name : str
        ``"output/input"``.
    measured : PairResponse
        The whole measured response.
    places : ndarray of int, shape (n,)
        Its frequencies that are fitted.
    weight_db, weight_deg : ndarray, shape (n,)
        Weights of squared decibels and degrees, the factor 20/n included.
    """

    name: str
    measured: PairResponse
    places: NDArray[np.intp]
    weight_db: NDArray[np.float64]
    weight_deg: NDArray[np.float64]

    @cached_property
    def omega_rad_s(self) -> NDArray[np.float64]:
        """Frequencies that are fitted, rad/s."""
        return np.ascontiguousarray(self.measured.omega_rad_s[self.places])

    @cached_property
    def response(self) -> NDArray[np.complex128]:
        """Measured values there."""
        return np.ascontiguousarray(self.measured.response[self.places])

    @property
    def band_rad_s(self) -> Band:
        """Lowest and highest fitted frequency, rad/s."""
        omega = self.omega_rad_s
        return float(omega[0]), float(omega[-1])


def select_points(
    data: FrequencyResponse,
    names: tuple[str, ...],
    *,
    bands: Bands,
    n_omega: int,
    minimum_coherence: float | None,
    weight_gain: float,
    weight_phase: float,
) -> list[SelectedResponse]:
    """Choose the fitted points of each response: log-spaced, on the measured grid, coherent.

    Raises
    ------
    UnknownNameError
        A band is given for a response that is not in the model.
    DataError
        Too few points of a response lie in its band with enough coherence.
    OptionError
        An option outside its range.
    """
    if isinstance(bands, Mapping):
        stray = set(bands) - set(names)
        if stray:
            raise UnknownNameError(
                "a band is given for a response that the model does not have",
                found=", ".join(sorted(stray)),
                needed=", ".join(names),
            )
    pairs = [data.pair(*name.split("/", 1)) for name in names]
    by_way = data.estimator.startswith(BY_EXCITATION)
    ends = injected_from(data) if by_way else 0.0, injected_to(data)

    def choose() -> list[tuple[NDArray[np.intp], NDArray[np.float64]]]:
        chosen = []
        for name, measured in zip(names, pairs, strict=True):
            band = bands.get(name) if isinstance(bands, Mapping) else bands
            pair = _steady(measured) if by_way else measured
            places = _places(pair, name, band, n_omega, minimum_coherence, ends)
            weight = COST_POINTS / len(places) * coherence_weight(pair.coherence[places])
            chosen.append((places, weight))
        return chosen

    # All that places and weights depend on.
    options = repr((bands, n_omega, minimum_coherence, ends))
    arrays = data.omega_rad_s, data.coherence, data.random_error, np.abs(data.response) > 0.0
    chosen = shared(
        lambda: (names, data.inputs, data.outputs, options, *(each.tobytes() for each in arrays)),
        choose,
    )
    return [
        SelectedResponse(name, pair, places, weight_gain * weight, weight_phase * weight)
        for name, pair, (places, weight) in zip(names, pairs, chosen, strict=True)
    ]


def _steady(pair: PairResponse) -> PairResponse:
    known = steady_coherence(pair.omega_rad_s, pair.coherence, pair.random_error)
    return replace(pair, coherence=known)


def _places(
    pair: PairResponse,
    name: str,
    band: Band | None,
    n_omega: int,
    minimum_coherence: float | None,
    ends: Band,
) -> NDArray[np.intp]:
    grid = pair.omega_rad_s
    if band is None:
        # What was injected ends the band that nobody gave, however coherent a loop is beyond it.
        injected = (grid >= ends[0] * (1.0 - _EDGE)) & (grid <= ends[1] * (1.0 + _EDGE))
        known, coherence = grid[injected], pair.coherence[injected]
        least = 0.0 if minimum_coherence is None else minimum_coherence
        found = usable_band(known, coherence, least)
        if found is not None and np.sum((grid >= found[0]) & (grid <= found[1])) < MINIMUM_POINTS:
            # A band of two points between gaps: all coherent ones, as `coherent_pairs` counts them.
            found = coherent_band(known, coherence, least)[0]
        if found is None:
            raise DataError(
                f"response {name} has no band to fit",
                found=f"coherence of at most {coherence.max(initial=0.0):.2f}",
                needed=f"neighbouring frequencies with at least {minimum_coherence}",
                action=f"give band_rad_s and a lower minimum_coherence, or {COHERENT_ALONE}",
            )
        band = found
    low, high = band
    if not (np.isfinite(low) and np.isfinite(high) and 0.0 < low < high):
        raise OptionError(
            f"band of response {name} has no meaning",
            found=f"{low:g} to {high:g} rad/s",
            needed="0 < low < high",
        )
    inside = (grid >= low * (1.0 - _EDGE)) & (grid <= high * (1.0 + _EDGE))
    if minimum_coherence is not None:
        inside &= pair.coherence >= minimum_coherence
    inside &= np.abs(pair.response) > 0.0
    usable = np.flatnonzero(inside)
    if len(usable) < MINIMUM_POINTS:
        raise DataError(
            f"response {name} has too few points to fit",
            found=f"{len(usable)} between {low:.4g} and {high:.4g} rad/s"
            + ("" if minimum_coherence is None else f" with coherence ≥ {minimum_coherence:g}"),
            needed=f"at least {MINIMUM_POINTS}",
            action=f"widen band_rad_s, lower minimum_coherence, or {COHERENT_ALONE}",
        )
    wanted = np.geomspace(grid[usable[0]], grid[usable[-1]], n_omega)
    return np.asarray(usable[np.unique(nearest(grid[usable], wanted))])
