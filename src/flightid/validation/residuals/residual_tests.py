"""The verb `residual_tests`: whether inputs or the past still predict the residuals."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from flightid.errors import DataError, OptionError
from flightid.evidence.feedback import feedback_test
from flightid.identification import Fit
from flightid.record import Record
from flightid.record.hold import LOOPS, common_loop
from flightid.record.repeats import found_period
from flightid.uncertainty.feedback import find_feedback
from flightid.uncertainty.feedback_result import FeedbackTest, declared_loop, unless_spread
from flightid.uncertainty.residual_correlation import (
    centred,
)
from flightid.validation.residuals.correlation_result import (
    Horizon,
    Kind,
    Loop,
)
from flightid.validation.residuals.correlation_setup import CorrelationSetup
from flightid.validation.residuals.data import Inputs, ResidualData, Residuals, gather_residuals
from flightid.validation.residuals.findings import residual_findings
from flightid.validation.residuals.result import ResidualTests
from flightid.validation.verification.result import Verification

Choice = TypeVar("Choice", Horizon, Loop)

SAMPLES_PER_LAG = 4


def residual_tests(
    residuals: Residuals,
    inputs: Inputs | None = None,
    *,
    outputs: Iterable[str] | None = None,
    excitations: Iterable[str] | None = None,
    horizon: Horizon | str | None = None,
    loop: Loop | str | None = None,
    maximum_lag: int = 25,
    fitted_noise: int | None = None,
    fitted_input: int | None = None,
) -> ResidualTests:
    """Test residuals for whiteness and independence of the inputs, linear and nonlinear.

    For each output φ_εε, against each other output φ_ε′ε (whether its past foretells this
    residual), and for each input φ_uε, φ_(u²)'ε, φ_(u²)'ε² and φ_ε(εu), about means, in
    units of the standard deviations. Whiteness takes the Ljung–Box statistic, independence a
    quadratic form in the inverse of the correlations' own covariance, which knows the colour of
    input and residual and, of output-error fits in an open loop, what the fit took out: lags
    from zero to 25 are judged then. `CorrelationTest` states the pass rule.

    Assumes stationary residuals. Biased when inputs are not persistent (a doublet): correlations
    with few independent samples leave the bands in either direction. A loop that is closed around
    a free run, or not known to be open, makes residual and input dependent for every model: the
    injected excitation then stands in place of the inputs where records hold it, and is named.

    Parameters
    ----------
    residuals : Fit or sequence of Fit, Verification, Record, sequence, mapping or array_like
        A fit of records or a verification (measured minus free run), polynomial fits of one output
        each to the same records, records whose outputs are residuals, or samples, shape
        (n_samples,) or (n_outputs, n_samples), by name or bare.
    inputs : names, mapping or array_like, optional
        With records: channel names; default: their inputs. Else samples as for `residuals`.
    outputs : iterable of str, optional
        Channels of records to test; default: all outputs.
    excitations : iterable of str, optional
        Injected signals, independent of noise, that free runs are tested against where a loop was
        closed; default: the records' channels of that role.
    horizon : {"one step ahead", "free run"}
        Which predictor made the residuals; a fit or verification knows.
    loop : {"open", "closed", "closed within the sample"}, optional
        Whether residuals reach the inputs; default: what records know, else tested on residuals
        and inputs. Closed: lags τ ≥ 0 are judged; within the sample (u(t) already holds y(t)):
        τ ≥ 1.
    maximum_lag : int
        Largest lag, samples.
    fitted_noise, fitted_input : int
        Parameters fitted to these very samples that whiten the residual (of A, C, D), and that
        take out the inputs (of B, F, per input); zero on records the fit has not seen. Default:
        those of a given fit, else zero.

    Raises
    ------
    OptionError
        The horizon is not said, more parameters than lags, or an option that is not known.
    ShapeError
        Arrays that do not fit.
    DataError
        Too few samples, a sample that is not finite, or nothing to test.
    UnknownNameError
        A record lacks a channel.

    Reference
    ---------
    Billings & Voon (1986), Correlation based model validity tests for non-linear models,
    Int. J. Control 44(1); Ljung, System Identification, 2nd ed., section 16.6.

    Example
    -------
    >>> rng = np.random.default_rng(0)
    >>> u, noise = rng.uniform(-1.0, 1.0, 2000), rng.standard_normal(2000)
    >>> missed = noise + 0.5 * np.roll(u, 3) ** 2
    >>> tests = residual_tests(missed, u, horizon="one step ahead")
    >>> [test.kind.value for test in tests.tests if test.verdict == "fail"]
    ['u²ε']
    """
    data = gather_residuals(
        residuals, inputs, outputs, None if horizon is None else _choice(Horizon, horizon)
    )
    fitted_noise = data.fitted_noise if fitted_noise is None else fitted_noise
    fitted_input = data.fitted_input if fitted_input is None else fitted_input
    how, feedback = _loop(data, loop or _known_loop(residuals), _measured(residuals))
    injected = _injected(residuals, excitations)
    bent = data.horizon is Horizon.FREE_RUN and feedback.loop != "open"
    if inputs is None and injected and bent:
        data = gather_residuals(residuals, injected, outputs, data.horizon)
        said = f"Tested against the injected {', '.join(injected)}, which no loop moves."
        data = replace(data, predictor=f"{data.predictor} {said}")
        # What was injected is independent of the noise at every lag.
        how = Loop.OPEN
    setup = CorrelationSetup(data, how, maximum_lag, fitted_noise, fitted_input)
    _require_lags(setup)
    tests = tuple(
        setup.test(kind, output, name)
        for output in data.residuals
        for kind, name in _kinds(data, output)
    )
    return ResidualTests(
        tuple(data.inputs),
        tuple(data.residuals),
        tests,
        data.horizon,
        data.predictor,
        setup.loop,
        maximum_lag,
        setup.n_samples,
        len(data.lengths),
        fitted_noise,
        fitted_input,
        residual_findings(tests),
        feedback,
    )


def _measured(residuals: Residuals) -> list[Record]:
    """The records behind residuals, where there are any."""
    if isinstance(residuals, Verification):
        return [each.measured for each in residuals.predictions]
    listed = residuals if isinstance(residuals, list | tuple) else [residuals]
    fitted = [part.measured for each in listed if isinstance(each, Fit) for part in each.records]
    return fitted or [each for each in listed if isinstance(each, Record)]


def _known_loop(residuals: Residuals) -> str | None:
    """What a fit was told of the loop, else what the records behind residuals know."""
    if isinstance(residuals, Fit):
        told = residuals.provenance.get("told")
        if isinstance(told, Mapping) and told.get("loop") in LOOPS:
            return str(told["loop"])
    return common_loop([each.input_shape for each in _measured(residuals)])


def _injected(residuals: Residuals, named: Iterable[str] | None) -> tuple[str, ...]:
    """Excitations that all records hold: those that are named, else those of that role."""
    records = _measured(residuals)
    if named is not None:
        return (named,) if isinstance(named, str) else tuple(named)
    if not records:
        return ()
    return tuple(name for name in records[0].excitations if all(name in r for r in records))


def _loop(
    data: ResidualData, declared: Loop | str | None, records: Sequence[Record]
) -> tuple[Loop, FeedbackTest]:
    """What is declared; else whether past residuals move what is new in the inputs.

    A direct path that was fitted takes a loop within the sample out of the residuals: where they
    see none, the measured outputs are asked, too. So they are where residuals see a loop: what a
    model misses of lightly damped or nonlinear motion follows the inputs as no noise does.
    """
    if declared is not None:
        chosen = _choice(Loop, declared)
        return chosen, declared_loop("open" if chosen is Loop.OPEN else "closed")
    if not data.inputs:
        return Loop.OPEN, declared_loop("open")
    inputs = [np.vstack(rows) for rows in zip(*map(centred, data.inputs.values()), strict=True)]
    left = [np.vstack(rows) for rows in zip(*map(centred, data.residuals.values()), strict=True)]
    repeats = all(found_period(rows) is not None for rows in inputs)
    channels = (*data.inputs, *data.residuals)
    found = find_feedback(inputs, left, tuple(data.inputs), repeats=repeats)
    found = unless_spread(found, [each.history for each in records], channels)
    held = bool(records) and all(name in record for record in records for name in channels)
    if held and found.source == "test":
        measured = feedback_test(records, inputs=data.inputs, outputs=data.residuals)
        if found.is_closed:
            overruled = measured.loop == "open" or measured.source in ("noisy input", "blind")
        else:
            overruled = not measured.is_known
        found = measured if overruled else found
    return (Loop.CLOSED if found.is_closed else Loop.OPEN), found


def _kinds(data: ResidualData, output: str) -> list[tuple[Kind, str | None]]:
    with_input = [kind for kind in Kind if kind not in (Kind.WHITENESS, Kind.CROSS)]
    pairs = [(kind, name) for name in data.inputs for kind in with_input]
    others = [(Kind.CROSS, name) for name in data.residuals if name != output]
    return [(Kind.WHITENESS, None), *others, *pairs]


def _choice(kind: type[Choice], value: str) -> Choice:
    try:
        return kind(value)
    except ValueError:
        raise OptionError(
            f"the {kind.__name__.lower()} is not known",
            found=repr(str(value)),
            needed="one of " + ", ".join(repr(str(item)) for item in kind),
        ) from None


def _require_lags(setup: CorrelationSetup) -> None:
    lags = setup.maximum_lag
    if lags < 1:
        raise OptionError("the largest lag is below one sample", found=lags, needed="1 or more")
    fitted = {
        "fitted_noise": (setup.fitted_noise, lags),
        "fitted_input": (setup.fitted_input, lags - setup.first_judged + 1),
    }
    for name, (count, limit) in fitted.items():
        if not 0 <= count < limit:
            raise OptionError(
                f"{name} leaves no degree of freedom",
                found=count,
                needed=f"0 to {limit - 1} with {lags} lags",
                action="raise maximum_lag",
            )
    if setup.n_samples < SAMPLES_PER_LAG * (lags + 1) or min(setup.data.lengths) < lags + 2:
        raise DataError(
            "the records are too short for so many lags",
            found=f"{setup.n_samples} samples, the shortest record {min(setup.data.lengths)}",
            needed=f"{SAMPLES_PER_LAG * (lags + 1)} samples, each record at least {lags + 2}",
            action="use longer records or a smaller maximum_lag",
        )
