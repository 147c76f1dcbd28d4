"""The verb of this stage: records in, frequency response out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.conventions import Light
from flightid.errors import DataError, OptionError
from flightid.findings import Finding
from flightid.record import Record
from flightid.record.history import Step
from flightid.responses.composite import combine
from flightid.responses.conditioned import Conditioned, condition, random_error
from flightid.responses.response import FrequencyResponse
from flightid.responses.samples import Samples, gather
from flightid.responses.spectra import Spectra, average_spectra
from flightid.responses.transform import FoldedBasis, WindowPlan
from flightid.responses.windows import (
    CYCLES_AT_LOWEST,
    HIGHEST_FRACTION,
    MINIMUM_LENGTH,
    automatic_windows,
    default_frequencies,
    longest_window,
    plan_of,
    shifts_of,
)
from flightid.table import Cell
from flightid.version import VERSION

HIGH_INPUT_COHERENCE = 0.5
"""Coherence between two inputs, averaged over the band, above which conditioning is doubtful."""
METHODS = ("composite",)
DETRENDS = ("none", "mean", "line")


def estimate_response(
    records: Record | Iterable[Record],
    *,
    inputs: Iterable[str] | str | None = None,
    outputs: Iterable[str] | str | None = None,
    omega_rad_s: ArrayLike | None = None,
    window_s: str | float | Sequence[float] = "auto",
    method: str = "composite",
    overlap: float = 0.5,
    detrend: str = "mean",
) -> FrequencyResponse:
    """Estimate the frequency responses of outputs to inputs from one or several records.

    Windows lie inside one record each. With several window lengths the result is their composite;
    with several inputs each response is conditioned on the others at every frequency.

    Parameters
    ----------
    records : Record or iterable of Record
        Manoeuvres of one vehicle in one condition, at one sample time.
    inputs, outputs : iterable of str, optional
        Channel names; default: the channels with these roles.
    omega_rad_s : tuple (low, high, n) or array_like, optional
        n log-spaced frequencies, or the frequencies themselves, rad/s. Default: 100 from two
        cycles in the longest window to a fifth of the sampling rate.
    window_s : "auto", float or sequence of float
        Window lengths, s; rounded to an even number of whole hops.
    method : {"composite"}
    overlap : float
        Overlap of neighbouring windows: 0, 0.5, 0.75, 0.8 …
    detrend : {"mean", "line", "none"}
        What is removed from each window by itself.

    Returns
    -------
    FrequencyResponse

    Raises
    ------
    DataError
        No record, records too short, an input without power, inputs that cannot be told apart.
    OptionError
        An option outside the range that has a meaning.
    UnitError
        A channel has different units in two records.
    UnknownNameError
        A record lacks a channel.

    Notes
    -----
    Assumes a linear time-invariant vehicle and noise at the outputs alone. Noise on a measured
    input makes the gain too low. Biased when a loop is closed around the vehicle and output noise
    reaches the input through it: then use the excitation as instrument.

    Reference
    ---------
    Tischler & Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., chapters 7, 9, 10;
    Bendat & Piersol, *Engineering Applications of Correlation and Spectral Analysis*, 2nd ed.

    Example
    -------
    >>> import numpy as np, flightid as fid
    >>> u = np.random.default_rng(0).standard_normal(4000)
    >>> y = 2.0 * np.concatenate([[0.0], u[:-1]])
    >>> record = fid.Record.from_arrays(np.arange(4000) / 100, inputs={"u": u}, outputs={"y": y})
    >>> response = fid.estimate_response(record, omega_rad_s=(2.0, 50.0, 20))
    >>> bool(np.all(np.abs(np.abs(response.response) - 2.0) < 0.05))
    True
    """
    _check_options(method, detrend)
    samples = gather(records, inputs, outputs, None, keep_mean=detrend == "none")
    omega = _frequencies(omega_rad_s, samples)
    plans = _plans(window_s, samples, float(omega[-1]), shifts_of(overlap))
    spectra = all_spectra(samples, omega, plans, detrend)
    n_inputs = len(samples.inputs)
    parts = [condition(one, n_inputs, omega, samples.inputs) for one in spectra]
    options: dict[str, Cell] = {
        "method": method,
        "window_s": ", ".join(f"{plan.length * samples.sample_time_s:.6g}" for plan in plans),
        "overlap": overlap,
        "detrend": detrend,
    }
    step = Step("estimate_response", options, VERSION)
    return _assemble(_Estimate(samples, omega, plans, spectra, parts, step), method)


@dataclass(frozen=True)
class _Estimate:
    samples: Samples
    omega: NDArray[np.float64]
    plans: Sequence[WindowPlan]
    spectra: Sequence[Spectra]
    parts: Sequence[Conditioned]
    step: Step


def all_spectra(
    samples: Samples, omega: NDArray[np.float64], plans: Sequence[WindowPlan], detrend: str
) -> list[Spectra]:
    """Spectra of every window length."""
    found = []
    for plan in plans:
        basis = FoldedBasis.of(plan, omega * samples.sample_time_s)
        found.append(average_spectra(samples.records, basis, samples.sample_time_s, detrend))
    return found


def _assemble(estimate: _Estimate, method: str) -> FrequencyResponse:
    samples, omega, plans = estimate.samples, estimate.omega, estimate.plans
    valid = _valid(plans, omega, samples.sample_time_s)
    composite = combine(estimate.parts, valid)
    n_in = len(samples.inputs)
    share = composite.weights.mean(axis=(1, 2))
    matrix = sum(
        weight[:, None, None] * one.matrix
        for weight, one in zip(share, estimate.spectra, strict=True)
    )
    spectrum = np.asarray(matrix).transpose(1, 2, 0)
    multiple = np.einsum("wof,wof->of", composite.weights.mean(axis=2), _multiple(estimate.parts))
    return FrequencyResponse(
        omega_rad_s=omega,
        inputs=samples.inputs,
        outputs=samples.outputs,
        units=samples.units,
        response=composite.response,
        coherence=composite.coherence,
        multiple_coherence=np.clip(multiple, 0.0, 1.0),
        random_error=random_error(composite.coherence, composite.n_independent, plans[0].shifts),
        n_independent=composite.n_independent,
        input_spectrum=spectrum[:n_in, :n_in],
        cross_spectrum=spectrum[:n_in, n_in:].transpose(1, 0, 2),
        output_spectrum=np.real(np.einsum("iif->if", spectrum[n_in:, n_in:])),
        n_windows=tuple(one.n_windows for one in estimate.spectra),
        window_s=tuple(plan.length * samples.sample_time_s for plan in plans),
        method=method,
        findings=_findings(estimate, spectrum[:n_in, :n_in]),
        history=(*samples.history, estimate.step),
    )


def _multiple(parts: Sequence[Conditioned]) -> NDArray[np.float64]:
    return np.array([part.multiple for part in parts])


def _valid(
    plans: Sequence[WindowPlan], omega: NDArray[np.float64], sample_time_s: float
) -> NDArray[np.bool_]:
    """Where each window holds two cycles; the longest window counts everywhere."""
    lengths = np.array([plan.length for plan in plans]) * sample_time_s
    cycles = np.multiply.outer(lengths, omega) / (2.0 * math.pi)
    valid = cycles >= CYCLES_AT_LOWEST * (1.0 - 1e-9)
    valid[int(np.argmax(lengths))] = True
    return np.asarray(valid)


def _frequencies(given: ArrayLike | None, samples: Samples) -> NDArray[np.float64]:
    if given is None:
        return default_frequencies(longest_window(samples.durations_s), samples.sample_time_s)
    if isinstance(given, tuple) and len(given) == 3 and isinstance(given[2], int | np.integer):
        low, high, count = float(given[0]), float(given[1]), int(given[2])
        if not 0.0 < low < high or count < 2:
            raise OptionError(
                "frequency band", found=given, needed="(low, high, n), 0 < low < high"
            )
        omega = np.geomspace(low, high, count)
    else:
        omega = np.unique(np.atleast_1d(np.asarray(given, dtype=np.float64)))
    nyquist = math.pi / samples.sample_time_s
    if not omega.size or not np.all(np.isfinite(omega)) or omega[0] <= 0.0 or omega[-1] >= nyquist:
        raise OptionError(
            "frequencies lie outside what the sample time can show",
            found=f"{omega.min(initial=math.inf):.4g} to {omega.max(initial=-math.inf):.4g} rad/s",
            needed=f"above 0 and below {nyquist:.4g} rad/s",
        )
    return omega


def _plans(
    window_s: str | float | Sequence[float], samples: Samples, omega_max: float, shifts: int
) -> list[WindowPlan]:
    if isinstance(window_s, str):
        if window_s != "auto":
            raise OptionError("window_s", found=repr(window_s), needed='"auto" or lengths in s')
        lengths: Sequence[float] = automatic_windows(samples.durations_s, omega_max)
    else:
        lengths = [float(one) for one in np.atleast_1d(np.asarray(window_s, dtype=np.float64))]
    plans = {plan_of(one, samples.sample_time_s, shifts) for one in lengths if one > 0.0}
    longest = max(record.shape[1] for record in samples.records)
    for plan in plans:
        if not MINIMUM_LENGTH <= plan.length <= longest:
            raise DataError(
                "a window does not fit the records",
                found=f"{plan.length} samples",
                needed=f"{MINIMUM_LENGTH} to {longest} samples, the longest record",
                action="choose other window_s",
            )
    if not plans:
        raise OptionError("window_s", found=window_s, needed="positive lengths in s")
    return sorted(plans, key=lambda plan: -plan.length)


def _check_options(method: str, detrend: str) -> None:
    for name, value, known in (("method", method, METHODS), ("detrend", detrend, DETRENDS)):
        if value not in known:
            raise OptionError(name, found=repr(value), needed="one of " + ", ".join(known))


def _findings(estimate: _Estimate, input_spectrum: NDArray[np.complex128]) -> tuple[Finding, ...]:
    samples, omega = estimate.samples, estimate.omega
    found = []
    longest_s = estimate.plans[0].length * samples.sample_time_s
    lowest = CYCLES_AT_LOWEST * 2.0 * math.pi / longest_s
    if omega[0] < lowest * (1.0 - 1e-6):
        found.append(
            Finding(
                "below-two-cycles",
                Light.AMBER,
                f"frequencies from {omega[0]:.3g} rad/s have less than two cycles in the longest "
                f"window ({longest_s:.3g} s)",
                f"trust the response from {lowest:.3g} rad/s, or use longer windows",
            )
        )
    highest = HIGHEST_FRACTION * 2.0 * math.pi / samples.sample_time_s
    if omega[-1] > highest * (1.0 + 1e-6):
        found.append(
            Finding(
                "above-a-fifth-of-the-rate",
                Light.AMBER,
                f"frequencies reach {omega[-1]:.3g} rad/s; a fifth of the sampling rate is "
                f"{highest:.3g} rad/s",
                "check filters and sampling delay there, or record faster",
            )
        )
    return (*found, *_correlated_inputs(samples.inputs, input_spectrum))


def _correlated_inputs(names: tuple[str, ...], spectrum: NDArray[np.complex128]) -> list[Finding]:
    auto = np.real(np.einsum("iif->if", spectrum))
    found = []
    for first in range(len(names)):
        for second in range(first + 1, len(names)):
            squared = np.abs(spectrum[first, second]) ** 2
            mean = float(np.mean(squared / (auto[first] * auto[second])))
            if mean > HIGH_INPUT_COHERENCE:
                found.append(
                    Finding(
                        "inputs-correlated",
                        Light.AMBER,
                        f"inputs {names[first]} and {names[second]} are correlated: coherence "
                        f"{mean:.2f} on average, {HIGH_INPUT_COHERENCE} is the limit",
                        "excite them one at a time or by independent signals",
                    )
                )
    return found
