"""Orthogonal multisines for several inputs at once, with phases that keep their peaks low."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.conventions import Light
from flightid.errors import OptionError, ShapeError
from flightid.excitation.checks import (
    require_band,
    require_not_negative,
    require_positive,
    whole_samples,
)
from flightid.excitation.excitation import Excitation
from flightid.excitation.phases import Lines, best_phases, schroeder_phases, start_at_zero
from flightid.findings import Finding

FEWEST_CYCLES = 2.0
"""Cycles of the lowest harmonic that a period should hold (Klein & Morelli, section 9.3)."""

Power = Callable[[NDArray[np.float64]], ArrayLike]


def multisine(
    *,
    band_rad_s: tuple[float, float],
    amplitude: float,
    period_s: float,
    sample_rate_hz: float,
    names: tuple[str, ...] = ("u",),
    unit: str = "1",
    periods: int = 1,
    power: Power | None = None,
    optimise: bool = True,
    starts: int = 8,
    seed: int = 0,
) -> Excitation:
    """Sums of harmonics of one period, dealt to the inputs in turn: orthogonal in time and band.

    ``u_j = sum over k in K_j of A_j sqrt(p_k) cos(2 pi k t / T + phi_k)``. Phases start from
    Schroeder's and from random ones, and minimise the peak through norms of rising order; then
    the origin of time moves so that each input starts at zero.

    Parameters
    ----------
    band_rad_s : tuple of float
        Lowest and highest frequency, rad/s.
    amplitude : float
        Largest magnitude of each input, in `unit`.
    period_s : float
        Period, s; a whole number of samples. Harmonics are 1/period apart.
    sample_rate_hz : float
        Samples per second, Hz.
    names : tuple of str
        Inputs, excited at the same time.
    unit : str
        Unit of the inputs.
    periods : int
        Repetitions.
    power : callable, optional
        Relative power of the harmonics from their frequencies in rad/s; default: flat.
    optimise : bool
        False keeps Schroeder's phases.
    starts : int
        Sets of phases tried: Schroeder's and random ones.
    seed : int
        Seed of the random phases.

    Returns
    -------
    Excitation
        Options hold the harmonics of each input.

    Raises
    ------
    OptionError
        A band with fewer than two harmonics for each input, or options without meaning.
    ShapeError
        `power` does not give one value for each harmonic.

    Reference
    ---------
    Klein & Morelli, Aircraft System Identification, section 9.3.2; Schroeder, IEEE Trans.
    Information Theory 16 (1970) 85; Guillaume et al., IEEE Trans. Instrumentation and
    Measurement 40 (1991) 982 (norms of rising order).

    Example
    -------
    >>> both = multisine(band_rad_s=(1.2, 12.0), amplitude=0.1, period_s=10.0,
    ...                  sample_rate_hz=50.0, names=("tau_phi", "tau_theta"), starts=3)
    >>> bool(abs(both.correlation()[0, 1]) < 1e-12), bool(max(both.peak_factor) < 1.1)
    (True, True)
    """
    low, high = require_band(band_rad_s, sample_rate_hz)
    require_positive(amplitude=amplitude, starts=starts, periods=periods)
    require_not_negative(seed=seed)
    count = whole_samples(period_s, sample_rate_hz, "period")
    dealt = deal_harmonics((low, high), period_s, len(names))
    options: dict[str, str | float | int | bool | None] = {
        "amplitude": amplitude,
        "period_s": period_s,
        "periods": periods,
        "optimise": optimise,
        "starts": starts,
        "seed": seed,
    }
    signals = np.empty((len(names), count))
    for index, (name, harmonics) in enumerate(zip(names, dealt, strict=True)):
        lines = Lines(harmonics, _line_amplitudes(harmonics, period_s, power))
        if optimise:
            phases = best_phases(lines, starts=starts, seed=seed + index)
        else:
            phases = schroeder_phases(lines)
        signal = lines.wave(start_at_zero(lines, phases), count)
        signals[index] = amplitude * signal / np.max(np.abs(signal))
        options[f"harmonics {name}"] = " ".join(map(str, harmonics))
    return Excitation(
        np.tile(signals, periods),
        1 / sample_rate_hz,
        tuple(names),
        unit,
        "multisine",
        (low, high),
        options,
        _findings(dealt, period_s),
    )


def deal_harmonics(
    band_rad_s: tuple[float, float], period_s: float, n_inputs: int
) -> list[NDArray[np.int64]]:
    """Harmonics of one period inside a band, dealt to inputs in turn.

    Parameters
    ----------
    band_rad_s : tuple of float
        Lowest and highest frequency, rad/s.
    period_s : float
        Period, s.
    n_inputs : int
        Number of inputs.

    Returns
    -------
    list of ndarray
        Whole numbers of cycles in a period, one array for each input.

    Raises
    ------
    OptionError
        Fewer than two harmonics for each input.

    Reference
    ---------
    Klein & Morelli, Aircraft System Identification, section 9.3.2.

    Example
    -------
    >>> deal_harmonics((6.2, 32.0), 1.0, 2)
    [array([1, 3, 5]), array([2, 4])]
    """
    slack = 1e-9
    first = math.ceil(band_rad_s[0] * period_s / (2 * math.pi) - slack)
    last = math.floor(band_rad_s[1] * period_s / (2 * math.pi) + slack)
    available = last - max(first, 1) + 1
    if n_inputs < 1 or available < 2 * n_inputs:
        raise OptionError(
            "too few harmonics of the period lie inside the band",
            found=f"{max(available, 0)} harmonics for {n_inputs} inputs",
            needed="two or more for each input",
            action="lengthen the period or widen the band",
        )
    harmonics = np.arange(max(first, 1), last + 1)
    return [harmonics[index::n_inputs] for index in range(n_inputs)]


def _line_amplitudes(
    harmonics: NDArray[np.int64], period_s: float, power: Power | None
) -> NDArray[np.float64]:
    if power is None:
        return np.ones(harmonics.size)
    omega = np.asarray(2 * np.pi * harmonics / period_s, dtype=np.float64)
    given = np.asarray(power(omega), dtype=np.float64)
    if given.shape != harmonics.shape:
        raise ShapeError(
            "power does not fit the harmonics", found=given.shape, needed=harmonics.shape
        )
    if not np.all(np.isfinite(given) & (given > 0)):
        raise OptionError("relative power must be positive at every harmonic")
    return np.asarray(np.sqrt(given))


def _findings(dealt: list[NDArray[np.int64]], period_s: float) -> tuple[Finding, ...]:
    slowest = int(min(harmonics[0] for harmonics in dealt))
    if slowest >= FEWEST_CYCLES:
        return ()
    return (
        Finding(
            "one-cycle-in-a-period",
            Light.AMBER,
            f"the lowest harmonic makes {slowest} cycle in the period of {period_s:g} s",
            f"lengthen the period or start the band at {4 * math.pi / period_s:.3g} rad/s",
        ),
    )
