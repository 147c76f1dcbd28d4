"""Margins of many loops at once from their frequency responses: arrays in, arrays out.

Only where a response passes the unit circle or the negative real axis is anything but a product
computed, so that thousands of draws of a model cost no more than their evaluation.
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.control.margins.crossings import (
    Crossings,
    gain_crossings,
    gains_at,
    level_crossings,
    phase_crossings,
    phases_from_axis,
)
from flightid.errors import DataError, ShapeError
from flightid.frozen import dataclass

Array = NDArray[np.float64]
DISTURBANCE_LEVEL_DB = -3.0
"""Level of the sensitivity that bounds the disturbance-rejection bandwidth."""
TINY = 1e-300
ON_AXIS = 1e-9
"""Share of the imaginary part below which the last point counts as real."""
OCTAVE = 2.0
"""The gain's slope at the lowest frequencies is taken over this ratio."""
READ_AT = {
    "crossover_rad_s": "crossover_rad_s",
    "phase_margin_deg": "crossover_rad_s",
    "gain_margin_db": "phase_crossover_rad_s",
    "gain_reduction_margin_db": "gain_reduction_rad_s",
    "delay_margin_s": "delay_crossover_rad_s",
    "sensitivity_peak": "sensitivity_peak_rad_s",
    "disturbance_bandwidth_rad_s": "disturbance_bandwidth_rad_s",
}
"""Numbers of a loop, and the fields that say at which frequency each is read."""


@dataclass(frozen=True, eq=False)
class LoopMetrics:
    """Result of `loop_metrics`: each array has the leading axes of the loops.

    NaN stands where there is no crossing in the band, that is, where the band sets no limit.

    Attributes
    ----------
    crossover_rad_s : ndarray
        Where the gain passes one with the least phase to spare, rad/s.
    phase_margin_deg : ndarray
        Phase to spare there, lag or lead, degrees; negative for an unstable loop.
    gain_margin_db : ndarray
        By how much the gain may rise, dB; negative: by how much it must fall.
    phase_crossover_rad_s : ndarray
        Where the gain margin is taken, rad/s.
    gain_reduction_margin_db : ndarray
        By how much the gain may fall, dB; negative: by how much it must rise.
    gain_reduction_rad_s : ndarray
        Where that is taken, rad/s.
    delay_margin_s : ndarray
        Delay to spare, s; negative for an unstable loop.
    delay_crossover_rad_s : ndarray
        Where that is taken, rad/s.
    sensitivity_peak, complementary_peak : ndarray
        Greatest ``|1/(1+L)|`` and ``|L/(1+L)|``.
    sensitivity_peak_rad_s, complementary_peak_rad_s : ndarray
        Where, rad/s.
    disturbance_bandwidth_rad_s : ndarray
        Lowest frequency at which ``|1/(1+L)|`` rises through −3 dB, rad/s.
    disturbance_peak_db : ndarray
        Greatest ``|1/(1+L)|``, dB.
    unstable_poles : ndarray of float
        Unstable poles of the closed loop, as given or by the Nyquist criterion in the band; below
        zero where the open loop must have more than were given.

    Example
    -------
    >>> omega = np.geomspace(0.1, 100.0, 200)
    >>> float(loop_metrics(omega, 5.0 / (1j * omega)).phase_margin_deg.round(6))
    90.0
    """

    crossover_rad_s: Array
    phase_margin_deg: Array
    gain_margin_db: Array
    phase_crossover_rad_s: Array
    gain_reduction_margin_db: Array
    gain_reduction_rad_s: Array
    delay_margin_s: Array
    delay_crossover_rad_s: Array
    sensitivity_peak: Array
    sensitivity_peak_rad_s: Array
    complementary_peak: Array
    complementary_peak_rad_s: Array
    disturbance_bandwidth_rad_s: Array
    disturbance_peak_db: Array
    unstable_poles: Array

    @property
    def is_stable(self) -> NDArray[np.bool_]:
        """Whether the closed loop has no unstable pole, by the Nyquist criterion in the band."""
        return np.asarray(self.unstable_poles <= 0.0)

    @property
    def modulus_margin(self) -> Array:
        """Least distance of the loop from −1."""
        return np.asarray(1.0 / self.sensitivity_peak)

    def __repr__(self) -> str:
        """Number of loops and worst margins on one line."""
        count = int(np.size(self.phase_margin_deg))
        stable = int(np.count_nonzero(self.is_stable))
        peak = float(np.max(self.sensitivity_peak))
        return f"LoopMetrics({count} loops, {stable} stable, worst sensitivity peak {peak:.3g})"


def loop_metrics(
    omega_rad_s: ArrayLike,
    loop: ArrayLike,
    *,
    unstable_poles: ArrayLike = 0,
    closed_unstable_poles: ArrayLike | None = None,
) -> LoopMetrics:
    """Crossover, margins, sensitivity peaks and disturbance rejection of many loops.

    Between grid points dB and degrees are straight lines over log frequency; peaks are those of a
    parabola through the three highest points. Of several crossings the worst one counts.

    Parameters
    ----------
    omega_rad_s : array_like, shape (n_f,)
        Frequencies, positive and increasing, rad/s.
    loop : array_like of complex, shape (..., n_f)
        Broken-loop responses L for negative feedback: ``1 + L = 0`` is critical.
    unstable_poles : array_like of int
        Unstable poles of the open loops, one number or one for each.
    closed_unstable_poles : array_like of int, optional
        Unstable poles of the closed loops where they are known. The grid need then not begin below
        every crossing, and nothing below it is taken from its beginning.

    Returns
    -------
    LoopMetrics
        Arrays over the leading axes.

    Raises
    ------
    ShapeError
        The loops have not as many values as there are frequencies, or there are fewer than three.
    DataError
        Frequencies that do not increase, or a loop that is zero or not finite somewhere.

    Assumes
    -------
    A grid that begins below and ends above every crossing and is fine enough that no phase moves
    by 180° between points. What lies below the grid is taken from its beginning: as many
    integrators as the gain's slope there shows, else a constant. Biased where a resonance is
    narrower than the grid.

    Reference
    ---------
    Franklin, Powell & Emami-Naeini, *Feedback Control of Dynamic Systems*, 7th ed., sections 6.3
    (Nyquist criterion) and 6.4 (margins); Tischler, Berger, Ivler, Mansur, Cheung & Soong,
    *Practical Methods for Aircraft and Rotorcraft Flight Control Design* (2017), chapter 5
    (disturbance rejection).

    Example
    -------
    >>> omega = np.geomspace(0.1, 100.0, 400)
    >>> gains = np.array([[2.0], [4.0]])
    >>> found = loop_metrics(omega, gains * np.exp(-0.1j * omega) / (1j * omega))
    >>> found.gain_margin_db.round(1), found.delay_margin_s.round(3)
    (array([17.9, 11.9]), array([0.685, 0.293]))
    """
    omega, values = _checked(omega_rad_s, loop)
    lead, rows = values.shape[:-1], values.reshape(-1, values.shape[-1])
    begun = _unstable(unstable_poles, lead)
    logs = np.log(omega)
    rows, ends = _ending(omega, rows)
    passes, starts = phase_crossings(logs, rows), _beginning(omega, rows)
    if closed_unstable_poles is None:
        unstable = begun + _encirclements(passes, starts.joined(ends), len(rows))
    else:
        unstable = _unstable(closed_unstable_poles, lead)
        starts = starts.kept(np.zeros(len(rows), dtype=np.bool_))
    sign = np.where(unstable > 0.0, -1.0, 1.0)
    found: dict[str, Array] = _phase_margins(gain_crossings(logs, rows), sign)
    found |= _gain_margins(passes.joined(starts.kept(starts.weight != 0.0)).joined(ends), sign)
    below = np.maximum(np.abs(1.0 + rows), TINY)
    inverse = np.log(below)
    found |= _peak("sensitivity_peak", logs, -inverse)
    found |= _peak("complementary_peak", logs, np.log(np.abs(rows)) - inverse)
    level = np.log(10.0) / 20.0 * DISTURBANCE_LEVEL_DB
    rising = level_crossings(logs, -inverse - level)
    rising = rising.kept(rising.weight > 0.0)
    found["disturbance_bandwidth_rad_s"] = _worst(rising, rising.omega, len(rows))[0]
    found["disturbance_peak_db"] = 20.0 * np.log10(found["sensitivity_peak"])
    found["unstable_poles"] = unstable
    shaped = {each.name: found[each.name].reshape(lead) for each in fields(LoopMetrics)}
    return LoopMetrics(**shaped)


def _checked(omega_rad_s: ArrayLike, loop: ArrayLike) -> tuple[Array, NDArray[np.complex128]]:
    omega = np.asarray(omega_rad_s, dtype=np.float64)
    values = np.asarray(loop, dtype=np.complex128)
    if omega.ndim != 1 or len(omega) < 3 or values.ndim < 1 or values.shape[-1] != len(omega):
        raise ShapeError(
            "loops and frequencies do not fit",
            found=f"{values.shape} at {omega.shape}",
            needed="(..., n_f) at (n_f,), three or more frequencies",
        )
    if not (omega[0] > 0.0 and np.all(np.diff(omega) > 0.0) and np.isfinite(omega[-1])):
        raise DataError("frequencies must be positive and increase", needed="rad/s, sorted")
    if not np.all(np.isfinite(values)) or np.any(values == 0.0):
        raise DataError(
            "a loop is zero or not finite at a frequency",
            needed="finite values other than zero",
            action="leave out frequencies at a pole or a zero on the imaginary axis",
        )
    return omega, values


def _unstable(given: ArrayLike, lead: tuple[int, ...]) -> Array:
    counts = np.asarray(given, dtype=np.float64)
    try:
        return np.broadcast_to(counts, lead).reshape(-1)
    except ValueError:
        raise ShapeError(
            "unstable_poles does not fit the loops", found=counts.shape, needed=lead
        ) from None


def _beginning(omega: Array, rows: NDArray[np.complex128]) -> Crossings:
    """What the path from zero frequency to the first grid point passes, by the gain's slope.

    With k integrators the response comes from infinity on the real axis and turns by −90° k. A
    path that starts on the negative axis leaves it as half a crossing, weight ±½; elsewhere 0.
    """
    first = rows[:, 0]
    second = min(max(int(np.searchsorted(omega, OCTAVE * omega[0])), 1), len(omega) - 1)
    rise = np.log(np.abs(rows[:, second] / first)) / np.log(omega[second] / omega[0])
    integrators = np.maximum(np.rint(-rise), 0.0)
    now = phases_from_axis(first)
    # Only starts at 0° or 180° have a meaning: the nearer one.
    axis = np.rint(now / np.pi + 0.5 * integrators)
    before, after = 0.5 * axis, np.where(now == 0.0, -TINY, now) / (2.0 * np.pi)
    on_axis = np.mod(axis, 2.0) == 0.0
    weight = np.floor(after) - np.floor(before) + np.where(on_axis, 0.5, 0.0)
    infinite = integrators > 0.0
    gain = np.where(infinite, np.inf, gains_at(first))
    at = np.where(infinite, 0.0, omega[0])
    return Crossings(np.arange(len(rows)), at, gain, weight)


def _ending(omega: Array, rows: NDArray[np.complex128]) -> tuple[NDArray[np.complex128], Crossings]:
    """Rows that end on the negative axis, as at π/T of a sampled loop: half a crossing.

    Such a point is moved a hair to the side from which the response comes, to be passed once.
    """
    last, before = rows[:, -1], rows[:, -2]
    places = np.flatnonzero((np.abs(last.imag) <= ON_AXIS * np.abs(last)) & (last.real < 0.0))
    if len(places):
        side = np.where(before[places].imag >= 0.0, 1.0, -1.0)
        rows = rows.copy()
        rows[places, -1] = last[places].real + 1j * side * TINY
        ends = np.full(len(places), omega[-1])
        return rows, Crossings(places, ends, gains_at(last[places]), 0.5 * side)
    none = np.zeros(0)
    return rows, Crossings(np.zeros(0, dtype=np.intp), none, none, none)


def _encirclements(passes: Crossings, starts: Crossings, n_rows: int) -> Array:
    """Clockwise turns about −1 over negative and positive frequencies."""
    found = np.zeros(n_rows)
    for each in (passes, starts):
        outside = each.kept(each.value > 0.0)
        np.add.at(found, outside.row, -2.0 * outside.weight)
    return found


def _worst(found: Crossings, size: Array, n_rows: int) -> tuple[Array, Array]:
    """Of each row the crossing of least size: its size and frequency; NaN for none."""
    order = np.lexsort((size, found.row))
    rows = found.row[order]
    first = np.ones(rows.size, dtype=np.bool_)
    np.not_equal(rows[1:], rows[:-1], out=first[1:])
    chosen = order[first]
    least, at = np.full(n_rows, np.nan), np.full(n_rows, np.nan)
    least[rows[first]], at[rows[first]] = size[chosen], found.omega[chosen]
    return least, at


def _phase_margins(found: Crossings, sign: Array) -> dict[str, Array]:
    margin, crossover = _worst(found, np.abs(found.value), len(sign))
    # Delay only lags: a phase that has lead to spare has all of the other way round.
    lag = np.where(sign[found.row] > 0.0, np.mod(found.value, 2.0 * np.pi), np.abs(found.value))
    delay, where = _worst(found, lag / found.omega, len(sign))
    return {
        "crossover_rad_s": crossover,
        "phase_margin_deg": sign * np.degrees(margin),
        "delay_margin_s": sign * delay,
        "delay_crossover_rad_s": where,
    }


def _gain_margins(found: Crossings, sign: Array) -> dict[str, Array]:
    """Room above and below; in an unstable loop what must fall is a negative room above."""
    margin = -20.0 / np.log(10.0) * found.value
    finite = np.isfinite(margin)
    upward = finite & (margin * sign[found.row] > 0.0)
    values = {}
    for name, at, kept in (
        ("gain_margin_db", "phase_crossover_rad_s", upward),
        ("gain_reduction_margin_db", "gain_reduction_rad_s", finite & ~upward),
    ):
        least, where = _worst(found.kept(kept), np.abs(margin[kept]), len(sign))
        values[name], values[at] = sign * least, where
    return values


def _peak(name: str, logs: Array, height: Array) -> dict[str, Array]:
    """Summit of a parabola through the highest point of each row and its neighbours."""
    rows, top = np.arange(len(height)), np.argmax(height, axis=1)
    middle = np.clip(top, 1, len(logs) - 2)
    inner = middle == top
    x0, x1, x2 = logs[middle - 1], logs[middle], logs[middle + 1]
    y0, y1, y2 = (height[rows, middle + shift] for shift in (-1, 0, 1))
    left, right = (y1 - y0) / (x1 - x0), (y2 - y1) / (x2 - x1)
    bend = (right - left) / (x2 - x0)
    # Slope at the middle point; the highest of three points cannot bend upwards.
    slope = left + bend * (x1 - x0)
    curved = inner & (bend < 0.0)
    shift = np.where(curved, -0.5 * slope / np.where(curved, bend, -1.0), 0.0)
    summit = np.where(curved, y1 + 0.5 * slope * shift, height[rows, top])
    return {name: np.exp(summit), f"{name}_rad_s": np.exp(logs[top] + shift)}
