"""The verb: a model and data to a fit, by the kinds of both and a method."""

from __future__ import annotations

from collections.abc import Sequence
from contextvars import copy_context
from dataclasses import replace
from functools import partial
from typing import Any

from flightid.conventions import Role
from flightid.errors import FitError, OptionError
from flightid.identification.damaged_samples import with_damage_judged
from flightid.identification.fed_back import (
    by_excitation,
    closed_around,
    with_bias_said,
    with_way_said,
)
from flightid.identification.fit import Fit
from flightid.identification.fit_evidence import evidence_of
from flightid.identification.held_inputs import hold_for, with_hold_said
from flightid.identification.hold_test import with_hold_tested
from flightid.identification.left_by_fit import LEFT, left_by_fit
from flightid.identification.loop_judged import with_loop_judged
from flightid.identification.methods import flat, method_of
from flightid.identification.residual_evidence import (
    in_doubt,
    with_minimum_doubted,
    with_residuals_judged,
)
from flightid.identification.training import data_provenance
from flightid.models import GreyBoxModel
from flightid.models.innovations.structure import SubspaceStructure
from flightid.models.narx.structure import NarxStructure
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.record import Record
from flightid.record.hold import Loop
from flightid.responses import FrequencyResponse
from flightid.responses.windows.kept_bases import bases_kept
from flightid.threads import on_one_thread
from flightid.uncertainty.feedback_result import declared_loop

JointData = tuple[FrequencyResponse, Record | Sequence[Record]]
Data = FrequencyResponse | Record | Sequence[Record] | JointData
Structure = GreyBoxModel | NarxStructure | PolynomialStructure | SubspaceStructure


@on_one_thread
def identify(
    model: Structure,
    data: Data,
    *,
    method: str | None = None,
    loop: Loop | None = None,
    **options: Any,  # noqa: ANN401 - the method checks them
) -> Fit:
    """Fit the free parameters of a model to data.

    By the kinds of model and data, the default first:

    - model on a frequency response: ``"frequency_domain"``. Each response is fitted at `n_omega` of
      its measured frequencies, log-spaced over its band. The cost of one response is (20/n) Σ W_γ
      [W_g (Δ dB)² + W_p (Δ degrees)²] with W_γ = [1.58 (1 − exp(−γ²))]².
    - model on records: ``"output_error"``. The model runs free through all records and its
      parameters, with initial states and biases of each record, maximise the likelihood of
      measured minus model: ½ Σ vᵀR⁻¹v + (N/2) ln det R with estimated noise covariance R.
    - state-space model on records, all states measured: ``"equation_error"`` (least squares on
      local derivatives) and ``"fourier_regression"`` (on Fourier integrals of the equations).
    - state-space model on records: ``"fourier_output_error"`` (outputs at the records' harmonics;
      biases drop out, unstable models are no special case) and ``"filter_error"`` (a Kalman filter
      with estimated process noise, for turbulence).
    - model on (response, records): ``"joint"``. Both likelihoods together, the response's with the
      covariance of its errors; the flights of the response are to be others than the records.
    - `NarxStructure` on records: orthogonal least squares; polynomial structure
      (`PolynomialModel.arx` … `.general`) on records: prediction errors. Subspace structure
      (`InnovationsModel.subspace`): singular values, then prediction errors. Options are the
      model's.

    Parameters
    ----------
    model : GreyBoxModel, NarxStructure, PolynomialStructure or SubspaceStructure
        Structure, start values and bounds; everything in it is fitted.
    data : FrequencyResponse, Record or sequence of Record, or tuple of both
        Measured, with the model's channels, in the model's units.
    method : str, optional
        See above.
    loop : {"open", "closed"}, optional
        Whether anything moved the inputs after what the outputs did, for the evidence; default:
        what the data know, else a test.
    **options
        The method's own, any of these:
    starts : int
        Number of starts: the model's own values, then a Latin hypercube inside the bounds,
        or around the values where a bound is open.
    seed : int
        Seed of the hypercube.
    maximum_iterations : int
        Most steps of each start.
    hold : str, optional
        Default: what the data know (`Record.hold`), else as below, and a finding says so.
        What inputs do between samples. Records: "first" (straight lines, default) or "zero"
        (steps), as for `flightid.simulate`. Responses, for the correction of bias:
        "band_limited" (default: smooth, filtered before they were sampled), "first" or "zero".
        "zero" takes the output hold's half sample out of the model's delay.
    band_rad_s : tuple of float, or mapping of str to tuple, optional
        Responses: band (low, high), rad/s, of all or by name ``"output/input"``; default: for each
        response its widest band with `minimum_coherence`.
        Fourier methods on records: band of the harmonics; default: to two fifths of Nyquist.
    n_omega : int
        Responses: frequencies of each.
    minimum_coherence : float or None
        Responses: points with less coherence γ² are left out; None takes all.
    weight_gain, weight_phase : float
        Responses: weights W_g of a squared dB and W_p of a squared degree.
    cost : str
        Responses: ``"coherence"``: the cost above. ``"likelihood"``: generalised least squares on
        the complex response with the covariance of its errors; smaller intervals, less tolerant
        of a model that is too simple.
    correct_bias : bool
        Responses: take out what windows or local polynomials add by leakage and finite resolution,
        by comparing what was estimated with what the estimator makes of the model. Where that is
        impossible a finding says so; where it fails the fit is red and has no intervals.
    initial_state : "estimate", "measured", "trim" or mapping
        Records: state at the first sample of each: estimated (the search begins at the
        measurement), held at the measurement, whose noise then widens the intervals, or at the
        model's trim; or by state a number or one of these words, the others measured. States that
        no output tells are at trim.
    output_bias, input_bias : bool or sequence of str
        Records: constants added to outputs (default: all) and to inputs (default: none) of each
        record, estimated; True for all channels, or names.
    noise_covariance : {"diagonal", "full"}
        Records: whether the noise of different outputs may be correlated.
    loss : {"gaussian", "huber"}, loss_limit : float
        Records: "huber" counts residuals beyond `loss_limit` deviations less, for outliers.
    half_width : int
        Equation error: neighbours on each side of a local derivative.
    process_noise : sequence of str, optional
        Filter error: states driven by noise; default: those whose equations hold free parameters.
    start_from : {"model", "equation_error"}
        Records: where the first start comes from.

    Returns
    -------
    Fit
        Estimates with 95 % intervals that carry the errors of the data through the fit,
        Cramér–Rao bounds and insensitivities, costs, correlations, findings.

    Raises
    ------
    FitError
        No free parameter; parameters that the data cannot tell apart; a fit that diverged from
        every start; a likelihood without known errors.
    DataError
        A response without enough coherent points in its band; a record that is too short or holds
        a channel that does not change.
    UnitError
        Data and model disagree on the unit of a channel.
    UnknownNameError
        A channel of the model is not in the data.
    OptionError
        An option outside its range, or one that this kind of fit does not have.

    Assumes
    -------
    Responses: a bias that is the estimator's alone, and a model that can hold the vehicle: the
    correction is computed from the model. Biased when a loop was closed during the flight and the
    response was not estimated with the excitation as instrument. Errors of different outputs are
    taken as independent.
    Records: noise on the outputs alone, stationary, and measured inputs without noise; intervals
    allow for coloured noise. Biased in turbulence, which drives the states, and where a loop feeds
    the noise back into the inputs. An unstable model must be stabilised by its data: keep records
    short.

    Reference
    ---------
    Tischler & Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., eqs. 11.4, 11.5,
    12.24 to 12.28; intervals: Pintelon & Schoukens, *System Identification*, 2nd ed., §9.7.
    Output error: Klein & Morelli, *Aircraft System Identification*, §6.1; its intervals: Morelli &
    Klein (1997), J. Guidance 20(1), eqs. 19 to 25. Regression and filter error: the same book,
    chapters 5 to 7, and Jategaonkar, *Flight Vehicle System Identification*, chapters 5 and 6.
    NARX: Chen, Cowan & Grant, IEEE Trans. Neural Networks 2 (1991), section III.

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> truth = fid.load_model("rate_first_order").with_values({"Lp": -6.0, "Ltphi": 180.0})
    >>> omega = np.geomspace(1.0, 50.0, 100)
    >>> data = fid.FrequencyResponse.from_values(
    ...     omega, truth.frequency_response(omega), inputs=["tau_phi"], outputs=["p"],
    ...     units={"p": "rad/s"}, random_error=np.full(100, 0.02))
    >>> fit = fid.identify(fid.load_model("rate_first_order"), data)
    >>> round(fit.parameters["Lp"].value, 6), round(fit.parameters["Ltphi"].value, 6)
    (-6.0, 180.0)
    >>> time_s = np.arange(500) * 0.02
    >>> sweep = fid.Record.from_arrays(time_s, inputs={"tau_phi": 0.1 * np.sin(0.5 * time_s**2)})
    >>> fit = fid.identify(fid.load_model("rate_first_order"), fid.simulate(
    ...     truth, sweep, units={"p": "rad/s"}))
    >>> round(fit.parameters["Lp"].value, 6), round(fit.parameters["Ltphi"].value, 6)
    (-6.0, 180.0)
    """
    if loop is not None:
        declared_loop(loop)
    chosen = method_of(model, data, method)
    _require_roles(model, flat(data))
    closed = closed_around(model, flat(data), loop)
    if closed is not None and (excited := by_excitation(model, flat(data))) is not None:
        try:
            fit = identify(excited, data, loop=loop, **options)
        except FitError:
            pass
        else:
            return with_way_said(fit, closed)
    held = hold_for(chosen.options, flat(data), options)
    given = options if held is None else {**options, "hold": held.hold}
    with bases_kept():
        fit = chosen.run(model, data, given)
        # Where data chose among structures the fit knows which.
        structure = fit.structure or model
        fit = replace(fit, structure=structure, method=chosen.name, excited=_excited(flat(data)))
        told = options if loop is None else {**options, "loop": loop}
        channels = (*fit.model.inputs, *fit.model.outputs)
        known = data_provenance(flat(data), channels)
        fit = replace(fit, provenance={**fit.provenance, **known, "told": told})
        fit = with_damage_judged(fit, flat(data))
        if held is not None:
            fit = with_hold_said(*with_hold_tested(fit, chosen, data, given, held, loop))
    if not in_doubt(fit.findings):
        fit = with_residuals_judged(fit)
    fit = with_loop_judged(with_minimum_doubted(fit), loop)
    if closed is not None:
        fit = with_bias_said(fit, closed)
    fit = replace(fit, provenance={**fit.provenance, LEFT: left_by_fit(fit)})
    # Gathered once somebody asks for it, in the words of who asked for the fit.
    gathered: Any = partial(copy_context().run, evidence_of, fit, flat(data), loop)
    return replace(fit, evidence=gathered)


def _excited(data: Sequence[object]) -> tuple[Record, ...]:
    """Records behind direct responses that hold what was injected."""
    linear = [each.linear for each in data if isinstance(each, FrequencyResponse)]
    return tuple(record for each in linear if each is not None for record in each.excited)


def _require_roles(model: Any, data: Sequence[object]) -> None:  # noqa: ANN401 - any kind
    """Refuse a model whose inputs and outputs are the other way round in a record."""
    outputs = tuple(getattr(model, "outputs", None) or (model.output,))
    for record in data:
        if not isinstance(record, Record):
            continue
        roles = {name: channel.role for name, channel in record.channels.items()}
        swapped = [name for name in outputs if roles.get(name) is Role.INPUT]
        driven = [name for name in model.inputs if roles.get(name) is Role.OUTPUT]
        if len(swapped) == len(outputs) and len(driven) == len(model.inputs) and driven:
            raise OptionError(
                f"inputs and outputs are swapped for record {record.name!r}",
                found=f"inputs {', '.join(model.inputs)}; outputs {', '.join(outputs)}",
                needed=f"inputs {', '.join(record.inputs)}; outputs {', '.join(record.outputs)}",
                action="name inputs first, then outputs; or change roles with Record.with_roles",
            )
