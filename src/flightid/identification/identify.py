"""The verb: a model and data to a fit, by the kinds of both."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, overload

from flightid.errors import FitError
from flightid.identification.fit import Fit
from flightid.identification.frequency_domain import Options, fit_responses
from flightid.identification.narx_fit import NarxFit
from flightid.identification.orthogonal_least_squares import fit_narx
from flightid.identification.polynomial_fit import PolynomialFit
from flightid.identification.prediction_error import fit_polynomial
from flightid.identification.selection import Bands
from flightid.models import Model, StateSpaceModel, TransferFunctionModel
from flightid.models.narx import NarxModel
from flightid.models.polynomial_structure import PolynomialStructure
from flightid.record import Record
from flightid.responses import FrequencyResponse

# Kind of model, kind of data -> the fit; a new kind adds its line.
_FITS: dict[tuple[type, type], Callable[..., Any]] = {
    (TransferFunctionModel, FrequencyResponse): fit_responses,
    (StateSpaceModel, FrequencyResponse): fit_responses,
    (NarxModel, Record): fit_narx,
    (PolynomialStructure, Record): fit_polynomial,
}


@overload
def identify(model: NarxModel, data: Record | Sequence[Record]) -> NarxFit: ...


@overload
def identify(model: PolynomialStructure, data: Record | Sequence[Record]) -> PolynomialFit: ...


@overload
def identify(
    model: Model,
    data: FrequencyResponse,
    *,
    starts: int = ...,
    seed: int = ...,
    omega_rad_s: Bands = ...,
    n_omega: int = ...,
    minimum_coherence: float | None = ...,
    weight_gain: float = ...,
    weight_phase: float = ...,
    cost: str = ...,
    maximum_iterations: int = ...,
    correct_bias: bool = ...,
    hold: str = ...,
) -> Fit: ...


def identify(
    model: Model | NarxModel | PolynomialStructure,
    data: FrequencyResponse | Record | Sequence[Record],
    *,
    starts: int = 1,
    seed: int = 0,
    omega_rad_s: Bands = None,
    n_omega: int = 20,
    minimum_coherence: float | None = 0.6,
    weight_gain: float = 1.0,
    weight_phase: float = 0.01745,
    cost: str = "coherence",
    maximum_iterations: int = 200,
    correct_bias: bool = True,
    hold: str = "band_limited",
) -> Fit | NarxFit | PolynomialFit:
    """Fit the free parameters of a model to data.

    A `NarxModel` is fitted to one record or several by orthogonal least squares, a polynomial
    structure (`PolynomialModel.arx` … `.general`) by prediction errors; their options are their
    own and none below applies. For transfer functions each response is fitted at `n_omega` of
    its measured frequencies, log-spaced over its band. The cost of one response is (20/n) Σ W_γ
    [W_g (Δ dB)² + W_p (Δ degrees)²] with W_γ = [1.58 (1 − exp(−γ²))]².

    Parameters
    ----------
    model : TransferFunctionModel, StateSpaceModel, NarxModel or PolynomialStructure
        Structure, start values and bounds; every response in it is fitted.
    data : FrequencyResponse, or Record or sequence of Record
        Measured responses, or for a `NarxModel` records, with the model's channels, in the model's
        units.
    starts : int
        Number of starts: the model's own values, then a Latin hypercube inside the bounds.
    seed : int
        Seed of the hypercube.
    omega_rad_s : tuple of float, or mapping of str to tuple, optional
        Band (low, high), rad/s, of all responses or by name ``"output/input"``; default: for each
        response its widest band with `minimum_coherence`.
    n_omega : int
        Frequencies of each response.
    minimum_coherence : float or None
        Points with less coherence γ² are left out; None takes all.
    weight_gain, weight_phase : float
        Weights W_g of a squared dB and W_p of a squared degree.
    cost : str
        ``"coherence"``: the cost above. ``"likelihood"``: generalised least squares on the complex
        response with the covariance of its errors; smaller intervals, less tolerant of a model
        that is too simple.
    maximum_iterations : int
        Most steps of each start.
    correct_bias : bool
        Take out, in rounds of fit and correction, what windows or local polynomials add by leakage
        and finite resolution: computed from the fitted model's outputs on the measured inputs.
        Where that is impossible (a response from a file or from arithmetic, a model that diverges
        on the records) a finding says so and the fit stays as it is.
    hold : {"band_limited", "first", "zero"}
        What the inputs do between their samples, for that correction: smooth (filtered before they
        were sampled), straight lines, or steps. "zero" takes the output hold's half sample out of
        the model's delay; the others leave it there.

    Returns
    -------
    Fit, NarxFit or PolynomialFit
        Estimates with 95 % intervals that carry the errors of the response through the fit,
        Cramér–Rao bounds and insensitivities, costs, correlations, findings.

    Raises
    ------
    FitError
        No free parameter; parameters that the data cannot tell apart; a fit that diverged from
        every start; a likelihood without known errors.
    DataError
        A response without enough coherent points in its band.
    UnitError
        Data and model disagree on the unit of a channel.
    UnknownNameError
        A channel of the model is not in the data.
    OptionError
        An option outside its range, or one that this kind of model does not have.

    Assumes
    -------
    A response whose only bias is its estimator's, and a model that can hold the vehicle: the
    correction is computed from the model. Without the correction the bias of a windowed response
    of one short sweep can equal its scatter, which no interval covers. Biased when a loop was
    closed during the flight and the response was not estimated with the excitation as instrument.
    Errors of different outputs are taken as independent.

    Reference
    ---------
    Tischler & Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., eqs. 11.4, 11.5,
    12.24 to 12.28; intervals: Pintelon & Schoukens, *System Identification*, 2nd ed., §9.7.
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
    """
    options = Options(
        starts=starts,
        seed=seed,
        omega_rad_s=omega_rad_s,
        n_omega=n_omega,
        minimum_coherence=minimum_coherence,
        weight_gain=weight_gain,
        weight_phase=weight_phase,
        cost=cost,
        maximum_iterations=maximum_iterations,
        correct_bias=correct_bias,
        hold=hold,
    )
    single = data[0] if isinstance(data, list | tuple) and data else data
    fit = _FITS.get((type(model), type(single)))
    if fit is None:
        raise FitError(
            "there is no fit for this model and these data",
            found=f"{type(model).__name__} and {type(data).__name__}",
            needed="TransferFunctionModel or StateSpaceModel and FrequencyResponse, "
            "or NarxModel or PolynomialStructure and Record",
            action="estimate a response with flightid.estimate_response",
        )
    result: Fit | NarxFit | PolynomialFit = fit(model, data, options)
    return result
