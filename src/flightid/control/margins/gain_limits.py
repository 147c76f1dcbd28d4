"""How far a loop's gain may rise or fall: limits of stability, at any frequency, zero included."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from flightid.control.margins.crossings import gain_crossings, phase_crossings
from flightid.control.margins.loop_grid import zoomed
from flightid.control.margins.loop_metrics import LoopMetrics, loop_metrics
from flightid.control.margins.loop_source import BrokenLoop
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.uncertainty.estimate import Reading

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
ZOOMS = (1e-3, 1e-5)
"""Ratios at which points are put beside what was found, round by round."""
STEADY = 1e-3
"""Ratio below all frequencies of a loop at which it no longer moves."""
BARELY_DB = 0.1
"""Difference between limits that no one acts on."""
UNSEEN = "cannot be said: there is none in the band, and nothing was measured outside it"
GAIN_LIMITS = {
    "gain_margin_db": "phase_crossover_rad_s",
    "gain_reduction_margin_db": "gain_reduction_rad_s",
}
"""How far the gain may go, and where."""
_UNBOUNDED: WeakKeyDictionary[BrokenLoop, Array] = WeakKeyDictionary()
"""Frequencies of `everywhere` of loops that are still about."""
GAIN_MARGINS = (*GAIN_LIMITS, *GAIN_LIMITS.values())


def measured_up(loop: BrokenLoop) -> tuple[Array, LoopMetrics]:
    """Frequencies, drawn close around what counts where the loop is a model, and the metrics.

    Parameters
    ----------
    loop : BrokenLoop

    Returns
    -------
    tuple of ndarray, shape (n_f,), and LoopMetrics
    """
    omega, thing = loop.omega_rad_s, loop.uncertain.value
    for ratio in () if loop.measured else ZOOMS:
        values = loop.of(thing, omega)
        found = loop.metrics(omega, values)
        centres = [getattr(found, name) for name in vars(found) if name.endswith("rad_s")]
        logs, rows = np.log(omega), values[None, :]
        passed = [gain_crossings(logs, rows).omega, phase_crossings(logs, rows).omega]
        omega = zoomed(omega, np.concatenate([np.ravel(each) for each in centres] + passed), ratio)
    return omega, loop.metrics(omega, loop.of(thing, omega))


def everywhere(loop: BrokenLoop, omega: Array) -> Array | None:
    """All frequencies of a model's loop, close around its crossings; None of a measurement.

    Parameters
    ----------
    loop : BrokenLoop
    omega : ndarray, shape (n_f,)
        Frequencies of the band, rad/s.
    """
    if loop.measured:
        return None
    if loop.whole_rad_s is not None:
        # They are those of the loop as estimated, whichever of its draws is asked.
        if loop not in _UNBOUNDED:
            unbounded = replace(loop, omega_rad_s=loop.whole_rad_s, closed_unstable_poles=None)
            _UNBOUNDED[loop] = measured_up(unbounded)[0]
        omega = _UNBOUNDED[loop]
    return np.asarray(np.concatenate([STEADY * omega[:1], omega]))


def gain_limits(
    numbers: Mapping[str, float], loop: BrokenLoop, whole: Array, values: Complex
) -> dict[str, float]:
    """Gain margins of the band, and where it has none those of all frequencies.

    A real unstable pole leaves where the gain at zero frequency falls below one, on the real axis
    and below any band.

    Parameters
    ----------
    numbers : mapping of str to float
        Margins of the band, dB and rad/s; NaN where it has none.
    loop : BrokenLoop
    whole : ndarray, shape (n_f,)
        Of `everywhere`, rad/s.
    values : ndarray of complex, shape (n_f,)
        The loop's response there.

    Returns
    -------
    dict of str to float
        By key of `GAIN_LIMITS`, and the frequencies.
    """
    found = loop_metrics(whole, values, unstable_poles=loop.unstable_poles)
    chosen = {}
    for margin, place in GAIN_LIMITS.items():
        unlimited = loop.whole_rad_s is None or np.isnan(numbers[margin])
        source = vars(found) if unlimited else numbers
        chosen[margin], at = float(source[margin]), float(source[place])
        chosen[place] = 0.0 if at <= whole[1] else at
    return chosen


def loop_numbers(
    loop: BrokenLoop, omega: Array, things: Sequence[Any], names: Sequence[str]
) -> tuple[Array, Complex]:
    """Numbers of loops by name of `LoopMetrics`, shape (n, n_names), and the loops, (n, n_f)."""
    whole = everywhere(loop, omega)
    # All frequencies are those of the band and one below them, or others.
    asked = omega if whole is None or loop.whole_rad_s is not None else whole
    every = np.array([loop.of(each, asked) for each in things])
    values = every[:, len(asked) - len(omega) :]
    found = loop.metrics(omega, values)
    numbers = {name: np.array(getattr(found, name)) for name in (*GAIN_MARGINS, *names)}
    for place, each in enumerate(things if whole is not None else ()):
        assert whole is not None
        own = {name: float(row[place]) for name, row in numbers.items()}
        if asked is whole:
            seen = every[place]
        elif all(own[at] > whole[1] for at in GAIN_LIMITS.values()):
            continue  # a band that holds both limits has told them
        else:
            seen = loop.of(each, whole)
        for name, value in gain_limits(own, loop, whole, seen).items():
            numbers[name][place] = value
    return np.array([numbers[name] for name in names]).T, values


def outside_findings(loop: BrokenLoop, made: Mapping[str, Reading]) -> tuple[Finding, ...]:
    """Nearer limits of the gain that lie outside the band in which margins were looked for.

    Parameters
    ----------
    loop : BrokenLoop
    made : mapping of str to Estimate
        Margins as they are told.

    Returns
    -------
    tuple of Finding
    """
    if loop.whole_rad_s is None:
        return ()
    whole = everywhere(loop, loop.omega_rad_s)
    assert whole is not None
    values = loop.of(loop.uncertain.value, whole)
    none = dict.fromkeys([*GAIN_LIMITS, *GAIN_LIMITS.values()], np.nan)
    nearest = gain_limits(none, loop, whole, values)
    found = []
    for margin, place in GAIN_LIMITS.items():
        told, size = made[margin.removesuffix("_db")], abs(nearest[margin])
        if told.value is not None and size < abs(told.value) - BARELY_DB:
            found.append(
                Finding(
                    "gain-limit-outside-band",
                    Light.AMBER,
                    f"{told.name}: {told.value:.3g} dB in the band, and outside it "
                    f"{nearest[margin]:.3g} dB at {nearest[place]:.3g} rad/s",
                    "widen the band, where that frequency counts",
                )
            )
    return tuple(found)
