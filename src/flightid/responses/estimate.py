"""The verb of this stage: records in, frequency response out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.conventions import Light
from flightid.errors import DataError
from flightid.findings import Finding
from flightid.record import Record
from flightid.record.chosen_hold import shape_of
from flightid.record.digest import RecordDigests
from flightid.record.history import Step
from flightid.record.hold import InputShape, Loop, common_hold, common_loop
from flightid.record.several import as_records
from flightid.responses.errors.linear_estimate import LinearEstimate, WindowedWeights
from flightid.responses.estimators.local_polynomial import estimate_local_polynomial
from flightid.responses.estimators.periodic import estimate_periodic, estimate_repeating
from flightid.responses.estimators.prewhitened import PREWHITENED, estimate_prewhitened
from flightid.responses.estimators.windowed import (
    estimate_windowed,
    windowed_errors,
    windowed_response,
)
from flightid.responses.excited_band import end_findings
from flightid.responses.feedback import feedback_findings, feedback_of
from flightid.responses.injected_power import injected_power
from flightid.responses.injected_span import injected_span
from flightid.responses.options import ResponseOptions
from flightid.responses.response import FrequencyResponse
from flightid.responses.windows.defaults import DEFAULT_FREQUENCIES, DEFAULT_OVERLAP, shifts_of
from flightid.responses.windows.planning import plan_frequencies, plan_windows
from flightid.responses.windows.samples import Samples, gather
from flightid.table import Cell
from flightid.threads import on_one_thread
from flightid.uncertainty.feedback_result import FeedbackTest
from flightid.version import VERSION


@on_one_thread
def estimate_response(
    records: Record | Iterable[Record],
    *,
    inputs: Iterable[str] | str | None = None,
    outputs: Iterable[str] | str | None = None,
    excitations: Iterable[str] | str | None = None,
    band_rad_s: tuple[float, float] | None = None,
    n_omega: int = DEFAULT_FREQUENCIES,
    omega_rad_s: ArrayLike | None = None,
    window_s: str | float | Sequence[float] = "auto",
    estimator: str = "auto",
    overlap: float = DEFAULT_OVERLAP,
    detrend: str = "mean",
    covariance: bool = True,
    loop: Loop | None = None,
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
    band_rad_s : (float, float), optional
        Lowest and highest frequency, rad/s. Default: from two cycles in the longest window to a
        fifth of the sampling rate.
    n_omega : int
        Number of log-spaced frequencies in the band.
    omega_rad_s : array_like, optional
        The frequencies themselves, rad/s, in place of a band.
    window_s : "auto", float or sequence of float
        Window lengths, s; rounded to an even number of whole hops.
    excitations : str or iterable of str, optional
        Channels of injected signals that are independent of the noise; needed by "instrument".
        Default for that method: the channels with the role excitation. "auto" goes by way of those
        that are named, one for each input, unless the loop is known to be open.
    estimator : {"auto", "composite", "instrument", "local_polynomial", "periodic", "prewhitened"}
        "auto": "periodic" where all inputs repeat exactly over three settled periods or more and
        neither windows nor frequencies are asked for, else "instrument" with excitations that are
        named, else "composite".
        "composite": directly from inputs to outputs. "instrument": for records with a loop closed,
        by way of the excitation. "local_polynomial": without windows, for short records.
        "periodic": at the harmonics of inputs that repeat (`Record.period_s`), whole periods alone.
        "prewhitened": directly by a model of the noise, which a closed loop without a logged
        excitation does not bias.
    overlap : float
        Overlap of neighbouring windows: 0, 0.5, 0.75, 0.8 …
    detrend : {"mean", "line", "none"}
        What is removed from each window by itself.
    covariance : bool
        Keep what `FrequencyResponse.covariance_at` needs and what a fit needs to take the
        estimator's bias out (the samples and a noise spectrum).
    loop : {"open", "closed"}, optional
        Whether anything moved the inputs after what the outputs did; default: what the records
        know, else a test.

    Raises
    ------
    DataError
        No record, records too short, an input without power, inputs that cannot be told apart,
        fewer excitations than inputs.
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
    reaches the input through it: then use the excitation as instrument, or "prewhitened".

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
    >>> response = fid.estimate_response(record, band_rad_s=(2.0, 50.0), n_omega=20)
    >>> bool(np.all(np.abs(np.abs(response.response) - 2.0) < 0.05))
    True
    """
    ResponseOptions(
        loop=loop,
        estimator=estimator,
        n_omega=n_omega,
        window_s=window_s,
        overlap=overlap,
        detrend=detrend,
        covariance=covariance,
    )
    listed = list(as_records(records))
    if estimator == "instrument" and excitations is None and listed:
        excitations = listed[0].excitations
    used = excitations if estimator == "instrument" else None
    samples = gather(listed, inputs, outputs, used, keep_mean=detrend == "none")
    if estimator == "instrument" and not samples.excitations:
        raise DataError(
            "no excitation channel",
            found=f"channels {', '.join(listed[0].channels)}",
            needed="a channel with the role excitation, or excitations=…",
            action="log the injected signal, or use estimator='composite' and mind its bias",
        )
    planned = isinstance(window_s, str) and window_s == "auto"
    free = planned and detrend == "mean" and omega_rad_s is None
    omega = plan_frequencies(omega_rad_s, band_rad_s, n_omega, samples)
    options: dict[str, Cell] = {"estimator": estimator, "detrend": detrend}
    if estimator in ("local_polynomial", "periodic") or (estimator == "auto" and free):
        whole = _of_whole_records(estimator, samples, listed, omega, options, covariance=covariance)
        if whole is not None:
            return _with_excited(_with_inputs(whole, samples, listed, loop), listed)
    if estimator == "auto":
        names = _by_way(samples, listed, excitations, loop)
        options["estimator"] = estimator = "instrument" if names else "composite"
        if names:
            channels = samples.inputs, samples.outputs, names
            samples = gather(listed, *channels, keep_mean=detrend == "none")
    plans = plan_windows(window_s, samples, float(omega[-1]), shifts_of(overlap))
    _require_motion_in_windows(samples, max(plan.length for plan in plans))
    lengths = ", ".join(f"{plan.length * samples.sample_time_s:.6g}" for plan in plans)
    step = Step("estimate_response", options | {"window_s": lengths, "overlap": overlap}, VERSION)
    estimate = estimate_windowed(samples, omega, plans, detrend)
    response = windowed_response(estimate, estimator, step)
    if estimator == PREWHITENED:
        response = estimate_prewhitened(
            response,
            samples,
            listed,
            shifts=shifts_of(overlap),
            covariance=covariance,
            loop=loop,
        )
        return _with_excited(_with_inputs(response, samples, listed, loop), listed)
    response = _with_inputs(response, samples, listed, loop)
    if not covariance:
        return response
    try:
        errors = windowed_errors(estimate)
    except DataError as error:
        missing = Finding("no-covariance", Light.UNKNOWN, str(error))
        return replace(response, findings=(*response.findings, missing))
    linear = LinearEstimate.of(samples, WindowedWeights(errors), omega)
    return _with_excited(replace(response, errors=errors, linear=linear), listed)


def _by_way(
    samples: Samples,
    records: Sequence[Record],
    excitations: Iterable[str] | str | None,
    loop: Loop | None,
) -> list[str]:
    """Excitations that were named, by way of which a loop does not bias; none of an open one."""
    names = [excitations] if isinstance(excitations, str) else list(excitations or ())
    known = loop or common_loop([shape_of(record) for record in records])
    return [] if known == "open" or len(names) < len(samples.inputs) else names


def _of_whole_records(
    estimator: str,
    samples: Samples,
    records: Sequence[Record],
    omega: NDArray[np.float64],
    options: Mapping[str, Cell],
    *,
    covariance: bool,
) -> FrequencyResponse | None:
    """An estimate without windows; None where inputs do not ask for one."""
    found = "periodic" if estimator == "auto" else estimator
    step = Step("estimate_response", {**options, "estimator": found}, VERSION)
    if estimator == "local_polynomial":
        return estimate_local_polynomial(samples, omega, step, covariance=covariance)
    make = estimate_repeating if estimator == "auto" else estimate_periodic
    return make(samples, records, omega, step, covariance=covariance)


def _with_inputs(
    response: FrequencyResponse, samples: Samples, records: Sequence[Record], loop: Loop | None
) -> FrequencyResponse:
    """The response with what is known of its inputs: their hold, and whether they are fed back."""
    shapes = [shape_of(record) for record in records]
    channels = (*response.inputs, *response.outputs)
    if response.estimator.startswith("instrument"):
        test = FeedbackTest("unknown", "instrument")
    elif response.estimator == PREWHITENED:
        test = FeedbackTest("unknown", "noise model")
    else:
        test = feedback_of(samples, float(response.omega_rad_s[-1]), records, loop)
    span, power = injected_span(records), injected_power(records, response.inputs)
    known = replace(response, loop=test, injected_rad_s=span, injected=power)
    return replace(
        known,
        findings=(*response.findings, *feedback_findings(test), *end_findings(known)),
        input_shape=InputShape(common_hold(shapes), loop=common_loop(shapes)),
        digests=RecordDigests(records, channels),
    )


def _with_excited(response: FrequencyResponse, records: Sequence[Record]) -> FrequencyResponse:
    """A direct estimate that knows its records, where they hold an excitation for each input."""
    linear = response.linear
    least = min(len(each.excitations) for each in records)
    by_instrument = response.estimator.startswith("instrument")
    if linear is None or least < len(response.inputs) or by_instrument:
        return response
    return replace(response, linear=replace(linear, excited=tuple(records)))


def _require_motion_in_windows(samples: Samples, longest: int) -> None:
    """Refuse windows longer than every record in which an input moves: they do not see it."""
    for name, rows in zip(samples.inputs, zip(*samples.part("inputs"), strict=True), strict=True):
        moving = max((row.size for row in rows if np.ptp(row) > 0.0), default=0)
        if 0 < moving < longest:
            step = samples.sample_time_s
            raise DataError(
                f"input {name!r} moves only in records shorter than a window",
                found=f"{moving * step:.4g} s at most, windows of {longest * step:.4g} s",
                needed="windows that fit a record in which it moves",
                action=f"give window_s up to {moving * step:.4g}, or join the record's pieces by "
                "filling its gaps where it is read",
            )
