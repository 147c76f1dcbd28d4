"""Spectra of residuals, and of measurement and prediction side by side with their peaks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from flightid.conventions import Light
from flightid.errors import DataError, OptionError
from flightid.findings import Finding
from flightid.record import Record
from flightid.responses import FrequencyResponse, estimate_response
from flightid.responses.windows.defaults import (
    DEFAULT_FREQUENCIES,
    DEFAULT_OVERLAP,
    longest_window,
    overlap_factor,
    shifts_of,
)
from flightid.uncertainty.residual_correlation import LEVEL
from flightid.validation.spectra.prominent_peaks import prominent_peaks
from flightid.validation.spectra.result import Peak, ResidualSpectra, SpectrumComparison
from flightid.validation.verification.result import Verification

OVERLAP = overlap_factor(shifts_of(DEFAULT_OVERLAP)) ** 2
"""Variance with overlapped windows, over that of as many apart (`estimate_response`)."""
PEAK_DB = 3.0
"""Least height of a peak above its surroundings, dB; more where the spectrum is less certain."""
SHARE_ALLOWED = 0.10
"""Share of frequencies with significant coherence that is still green: neighbours hang together."""
PEAK_PERCENT = 5.0
"""Of the measured power: what a peak that one spectrum has alone must be worth to count."""
SAME_PEAK = 0.25
"""Largest relative distance of frequencies of a measured peak and the predicted one it matches."""
PEAK_LEVEL = 0.99
"""Of intervals that a peak must stand out of: those of 95 % find one in 7 of 25 white records."""
MOST_LAGS = 20
"""Lags of an output that a spectrum may ask for: a model of more fits noise, not dynamics."""


def residual_spectra(
    residuals: Verification | Record | Sequence[Record],
    inputs: Iterable[str] | None = None,
    *,
    outputs: Iterable[str] | None = None,
    band_rad_s: tuple[float, float] | None = None,
    n_omega: int = DEFAULT_FREQUENCIES,
    omega_rad_s: ArrayLike | None = None,
    window_s: float | None = None,
) -> ResidualSpectra:
    """Power spectra of residuals with chi-square bounds, and their coherence with each input.

    Coherence above its limit tells at which frequencies the model misses what the input does.
    Assumes stationary residuals; biased near peaks narrower than a few cycles in the window.

    Parameters
    ----------
    residuals : Verification, Record or sequence of Record
        Measured minus free run, or records whose outputs are residuals.
    inputs, outputs : iterable of str, optional
        Channels; default: by role, and those that were verified.
    band_rad_s, n_omega, omega_rad_s : optional
        Frequencies, as for `flightid.estimate_response`.
    window_s : float, optional
        Window, s; default: half of the automatic longest, about ten in all records.

    Raises
    ------
    DataError
        Records too short, or an input without power.
    UnknownNameError
        A record lacks a channel.

    Reference
    ---------
    Bendat & Piersol, Random Data, 4th ed., chapter 8 (chi-square bounds); Carter (1987), Coherence
    and time delay estimation, Proc. IEEE 75(2) (significant coherence).

    Example
    -------
    >>> import flightid as fid
    >>> rng = np.random.default_rng(0)
    >>> record = fid.Record.from_arrays(np.arange(4000) * 0.02,
    ...     inputs={"u": rng.normal(size=4000)}, outputs={"e": rng.normal(size=4000)})
    >>> spectra = residual_spectra(record)
    >>> level = 2 * 0.02  # of white noise of variance one, per Hz
    >>> inside = (spectra.low < level) & (level < spectra.high)
    >>> bool(inside.mean() > 0.8)
    True
    """
    records = _residual_records(residuals)
    response = _estimate(
        records, inputs, outputs, window_s, omega_rad_s, band_rad_s=band_rad_s, n_omega=n_omega
    )
    density, low, high = _with_bounds(response)
    n_effective = response.n_independent[:, :1, :] / OVERLAP
    free = np.maximum(n_effective - len(response.inputs), 1.0)
    limit = np.broadcast_to(1.0 - (1.0 - LEVEL) ** (1.0 / free), response.coherence.shape)
    return ResidualSpectra(
        response.omega_rad_s,
        response.inputs,
        response.outputs,
        dict(response.units),
        density,
        low,
        high,
        response.coherence,
        limit,
        response.window_s[0],
        _coherence_findings(response, limit),
    )


def compare_spectra(
    measured: Verification | Record,
    predicted: Record | None = None,
    *,
    outputs: Iterable[str] | None = None,
    band_rad_s: tuple[float, float] | None = None,
    n_omega: int = DEFAULT_FREQUENCIES,
    omega_rad_s: ArrayLike | None = None,
    window_s: float | None = None,
) -> SpectrumComparison:
    """Power spectra of measured and predicted outputs on one grid, with the peaks of both.

    Parameters
    ----------
    measured : Verification or Record
        A verification, or the measured record.
    predicted : Record, optional
        Predicted outputs under the same names; needed with a record.
    outputs : iterable of str, optional
        Outputs to compare; default: all.
    band_rad_s, n_omega, omega_rad_s, window_s : optional
        As for `residual_spectra`.

    Raises
    ------
    OptionError
        A record without its prediction, or a verification with one.
    DataError
        Records too short, or an input without power.
    UnknownNameError
        A record lacks a channel.

    Reference
    ---------
    Bendat & Piersol, Random Data, 4th ed., chapter 8.

    Example
    -------
    >>> import flightid as fid
    >>> time_s, rng = np.arange(3000) * 0.02, np.random.default_rng(0)
    >>> mode = fid.LinearSystem([[0.0, 1.0], [-16.0, -0.8]], [[0.0], [16.0]], [[1.0, 0.0]],
    ...                         [[0.0]], ("u",), ("y",))
    >>> seen = fid.simulate(mode, fid.Record.from_arrays(time_s,
    ...                     inputs={"u": rng.normal(size=3000)}))
    >>> [round(peak.omega_rad_s) for peak in compare_spectra(seen, seen).peaks][:1]
    [4]
    """
    if isinstance(measured, Verification) is (predicted is not None):
        raise OptionError(
            "a comparison needs one measurement and one prediction",
            needed="a verification alone, or two records",
        )
    if isinstance(measured, Verification):
        flown = tuple(item.measured for item in measured.predictions)
        made = tuple(item.predicted for item in measured.predictions)
        names = measured.outputs if outputs is None else tuple(outputs)
        driven: tuple[str, ...] = made[0].inputs
    else:
        flown, made = (measured,), (predicted,) if predicted is not None else ()
        names = measured.outputs if outputs is None else tuple(outputs)
        driven = measured.inputs
    one = _estimate(
        flown, driven, names, window_s, omega_rad_s, band_rad_s=band_rad_s, n_omega=n_omega
    )
    two = _estimate(made, driven, names, window_s, one.omega_rad_s)
    density, low, high = _with_bounds(one)
    model, model_low, model_high = _with_bounds(two)
    peaks, findings = [], []
    for index, name in enumerate(names):
        mine = _peaks(one.omega_rad_s, density[index], low[index], high[index])
        theirs = _peaks(one.omega_rad_s, model[index], model_low[index], model_high[index])
        found = _matched(name, mine, theirs)
        excess = _excess_percent(one.omega_rad_s, density[index], model[index])
        findings += [_peak_finding(peak, excess) for peak in found]
        peaks += found
    return SpectrumComparison(
        one.omega_rad_s, names, dict(one.units), density, low, high, model, tuple(peaks),
        one.window_s[0], tuple(findings),
    )  # fmt: skip


def lags_of_spectrum(
    records: Sequence[Record], inputs: Iterable[str], output: str
) -> tuple[int, Finding]:
    """Lags of an output that span the period of its spectrum's slowest peak; at most `MOST_LAGS`.

    A peak counts that stands out of its random error and holds `PEAK_PERCENT` of the power.

    Returns
    -------
    int
        Lags, samples.
    Finding
        Peak, period and bound; amber where the bound is shorter than the period.

    Raises
    ------
    DataError
        No peak stands out of the spectrum's random error, or records too short.

    Example
    -------
    >>> import flightid as fid
    >>> rng = np.random.default_rng(0)
    >>> mode = fid.LinearSystem([[0.0, 1.0], [-16.0, -0.8]], [[0.0], [16.0]], [[1.0, 0.0]],
    ...                         [[0.0]], ("u",), ("y",))
    >>> driven = fid.Record.from_arrays(np.arange(3000) * 0.1,
    ...                                 inputs={"u": rng.normal(size=3000)})
    >>> lags_of_spectrum([fid.simulate(mode, driven)], ["u"], "y")[0]  # 2 pi / 4 rad/s = 1.57 s
    16
    """
    response = _estimate(records, inputs, [output], None, None)
    omega = response.omega_rad_s
    density, low, high = (each[0] for each in _with_bounds(response, PEAK_LEVEL))
    share = _excess_percent(omega, density, np.zeros_like(density))
    peaks = [at for at, _ in _peaks(omega, density, low, high) if share(at) >= PEAK_PERCENT]
    if not peaks:
        raise DataError(
            f"no peak with {PEAK_PERCENT:g} % of the power stands out of the spectrum of {output}",
            needed="a resonance that the records resolve",
            action="give output_lags as a number, or several to rank by free run",
        )
    slowest, step_s = peaks[0], records[0].sample_time_s
    period_s = 2.0 * np.pi / slowest
    asked = int(np.ceil(period_s / step_s))
    said = f"the slowest peak of {output}, {slowest:.3g} rad/s, has a period of {period_s:.3g} s"
    if asked <= MOST_LAGS:
        message = f"{said}: {asked} lags of the output span it (at most {MOST_LAGS} are taken)"
        return asked, Finding("lags-of-spectrum", Light.GREEN, message)
    return MOST_LAGS, Finding(
        "lags-of-spectrum",
        Light.AMBER,
        f"{said}: {asked} lags would span it, {MOST_LAGS} are taken",
        f"resample records to {period_s / MOST_LAGS:.2g} s",
    )


def _residual_records(residuals: Verification | Record | Sequence[Record]) -> tuple[Record, ...]:
    if isinstance(residuals, Record):
        return (residuals,)
    if not isinstance(residuals, Verification):
        return tuple(residuals)
    return tuple(
        item.measured.replace({name: item.residual(name) for name in residuals.outputs}).with_roles(
            **dict.fromkeys(residuals.outputs, "output")
        )
        for item in residuals.predictions
    )


def _estimate(
    records: Sequence[Record],
    inputs: Iterable[str] | None,
    outputs: Iterable[str] | None,
    window_s: float | None,
    omega_rad_s: ArrayLike | None,
    *,
    band_rad_s: tuple[float, float] | None = None,
    n_omega: int = DEFAULT_FREQUENCIES,
) -> FrequencyResponse:
    length = window_s or 0.5 * longest_window([record.duration_s for record in records])
    return estimate_response(
        records,
        inputs=inputs,
        outputs=outputs,
        band_rad_s=band_rad_s,
        n_omega=n_omega,
        omega_rad_s=omega_rad_s,
        window_s=[length],
        covariance=False,
    )


def _with_bounds(
    response: FrequencyResponse, level: float = LEVEL
) -> tuple[NDArray[np.float64], ...]:
    """Auto-spectra with their intervals, each shape (n_out, n_f)."""
    density = np.asarray(response.output_spectrum, dtype=np.float64)
    degrees = 2.0 * response.n_independent[:, 0, :] / OVERLAP
    low = density * degrees / scipy.special.chdtri(degrees, 0.5 - 0.5 * level)
    high = density * degrees / scipy.special.chdtri(degrees, 0.5 + 0.5 * level)
    return density, low, high


def _coherence_findings(
    response: FrequencyResponse, limit: NDArray[np.float64]
) -> tuple[Finding, ...]:
    found = []
    for row, output in enumerate(response.outputs):
        for column, name in enumerate(response.inputs):
            coherence = response.coherence[row, column]
            share = float(np.mean(coherence > limit[row, column]))
            top = int(np.argmax(coherence))
            good = share <= SHARE_ALLOWED
            found.append(
                Finding(
                    "residual-coherence",
                    Light.GREEN if good else Light.AMBER,
                    f"{output}, {name}: residual and input cohere at {100 * share:.0f} % of "
                    f"frequencies (chance: 5 %), most at {response.omega_rad_s[top]:.3g} rad/s",
                    "" if good else "mend the model near that frequency",
                )
            )
    return tuple(found)


def _peaks(
    omega: NDArray[np.float64],
    density: NDArray[np.float64],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
) -> list[tuple[float, float]]:
    """Frequency and density of each peak that stands out of its own uncertainty."""
    level = 10.0 * np.log10(np.maximum(density, np.finfo(float).tiny))
    width = 10.0 * np.log10(np.maximum(high, 1e-300) / np.maximum(low, 1e-300))
    places = prominent_peaks(level, np.maximum(PEAK_DB, width))
    return [(float(omega[place]), float(density[place])) for place in places]


def _matched(
    name: str, measured: list[tuple[float, float]], predicted: list[tuple[float, float]]
) -> list[Peak]:
    """Each measured peak with the nearest predicted one, then predicted peaks left over."""
    left = list(predicted)
    peaks = []
    for omega, density in measured:
        near = [item for item in left if abs(item[0] - omega) <= SAME_PEAK * omega]
        best = min(near, key=lambda item: abs(item[0] - omega), default=None)
        if best is None:
            peaks.append(Peak(name, omega, density, None, None))
        else:
            left.remove(best)
            peaks.append(Peak(name, omega, density, *best))
    return peaks + [Peak(name, None, None, *item) for item in left]


def _excess_percent(
    omega: NDArray[np.float64], density: NDArray[np.float64], model: NDArray[np.float64]
) -> Callable[[float], float]:
    """What measurement and model differ by about a frequency, percent of the measured power."""
    whole = float(np.trapezoid(density, omega))

    def about(place: float) -> float:
        near = np.abs(omega - place) <= SAME_PEAK * place
        apart = float(np.trapezoid((density - model)[near], omega[near]))
        return 100.0 * abs(apart) / whole if whole > 0.0 else 100.0

    return about


def _peak_finding(peak: Peak, excess: Callable[[float], float]) -> Finding:
    if peak.omega_rad_s is not None and peak.predicted_rad_s is not None:
        said = f"peak at {peak.omega_rad_s:.3g} rad/s, model {peak.predicted_rad_s:.3g}"
        return Finding("peak-matched", Light.GREEN, f"{peak.output}: {said}")
    if peak.predicted_rad_s is not None:
        place, code, action = peak.predicted_rad_s, "peak-of-model-alone", "look at its modes"
        what = f"{peak.output}: the model has a peak at {place:.3g} rad/s alone"
    else:
        place, code, action = peak.omega_rad_s or 0.0, "peak-missed", "raise the order of the model"
        what = f"{peak.output}: the peak at {place:.3g} rad/s is not in the model"
    share = excess(place)
    what += f" (they differ there by {share:.2g} % of the measured power)"
    if share < PEAK_PERCENT:
        return Finding(code, Light.GREEN, what)
    return Finding(code, Light.AMBER, what, action)
