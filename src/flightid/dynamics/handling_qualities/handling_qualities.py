"""Everything of handling qualities that a model or a measured response supports, in one table."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, cast

from flightid.conventions import Light
from flightid.dynamics.handling_qualities.attitude_bandwidth import attitude_bandwidth
from flightid.dynamics.handling_qualities.mode_ratings import mode_ratings
from flightid.dynamics.handling_qualities.rating import Rating
from flightid.dynamics.handling_qualities.rating_charts_reading import rating_chart
from flightid.dynamics.handling_qualities.result import AttitudeBandwidth
from flightid.dynamics.handling_qualities.unrated import (
    ASK_N_ALPHA,
    divergence_findings,
    gaps,
    load_factor_slope,
    with_found_sign,
)
from flightid.dynamics.modes.modes import modes
from flightid.dynamics.modes.result import Modes
from flightid.errors import DataError, ModelError, OptionError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.uncertain_of import source_findings, uncertain_of
from flightid.models import TransferFunctionModel
from flightid.models.model import linear_system, model_of
from flightid.responses import FrequencyResponse
from flightid.result import Result
from flightid.table import Cell, Column, Table
from flightid.uncertainty.estimate import Reading
from flightid.uncertainty.quantiles import interval_words, shown

ATTITUDES = {"roll": ("phi", "p"), "pitch": ("theta", "q"), "yaw": ("psi", "r")}
CONTROLS = {
    "roll": ("lat", "delta_lat", "aileron", "tau_phi", "phi_command"),
    "pitch": ("lon", "delta_lon", "elevator", "tau_theta", "theta_command"),
    "yaw": ("ped", "delta_ped", "rudder", "tau_psi", "psi_command"),
}
"""Names by which an axis' control is known; others are given."""
VEHICLES = ("rotorcraft", "aeroplane")
Pairs = Mapping[str, tuple[str, str]]


@dataclass(frozen=True, eq=False, repr=False)
class HandlingQualities(Result, schema="flightid.handling_qualities/1"):
    """Result of `handling_qualities`.

    Attributes
    ----------
    vehicle : str
        ``"rotorcraft"`` or ``"aeroplane"``.
    conditions : mapping of str to str
        The case of the standard's requirements.
    bandwidths : mapping of str to AttitudeBandwidth
        By axis.
    modes : Modes or None
        Of a model.
    ratings : tuple of Rating
        Levels, as far as there are requirements.
    findings : tuple of Finding

    Example
    -------
    >>> import flightid as fid
    >>> fid.handling_qualities(fid.load_model("attitude_first_order"))
    HandlingQualities(1 axis, 1 level, worst Level 1)
    """

    vehicle: str
    conditions: Mapping[str, str]
    bandwidths: Mapping[str, AttitudeBandwidth]
    modes: Modes | None
    ratings: tuple[Rating, ...]
    findings: tuple[Finding, ...] = ()

    @property
    def worst(self) -> str:
        """The worst level in words; empty where nothing is rated."""
        if not self.ratings:
            return ""
        return max(self.ratings, key=lambda each: (each.possible[-1], each.at_best)).text

    def __repr__(self) -> str:
        """Counts and the worst level on one line."""
        axes, levels = len(self.bandwidths), len(self.ratings)
        words = (
            f"{axes} ax{'is' if axes == 1 else 'es'}, {levels} level{'' if levels == 1 else 's'}"
        )
        return f"HandlingQualities({words}" + (f", worst {self.worst})" if self.worst else ")")

    def summary(self, *, level: float | None = None) -> Table:
        """One table: each number with its interval, and each level with its probability.

        Parameters
        ----------
        level : float, optional
            Of the intervals; what a standard calls a level is not meant.
        """
        level = shown(level)
        words = interval_words(level)
        columns = (
            Column("what"),
            Column("quantity"),
            Column("value"),
            Column(f"{words} low"),
            Column(f"{words} high"),
            Column("unit"),
            Column("in Hz"),
            Column("level"),
            Column("probability of level 1", "%", 3),
            Column("standard"),
        )
        rows: list[tuple[Cell, ...]] = []
        for axis, found in self.bandwidths.items():
            own = [each for each in self.ratings if each.subject == found.name]
            for place, quantity in enumerate(found.quantities):
                rated = own[0] if own and place == 0 else None
                rows.append(_row(axis, quantity, rated, level))
        named = {found.name for found in self.bandwidths.values()}
        for rating in self.ratings:
            if rating.subject not in named:
                rows += _mode_rows(rating, level)
        doubts = {rating.chart.doubt for rating in self.ratings if rating.chart.doubt}
        case = ", ".join(f"{name} {value}" for name, value in self.conditions.items())
        notes = (f"{self.vehicle}: {case}.", FOR_PILOTS, *sorted(doubts), *map(str, self.findings))
        return Table("Handling qualities", columns, tuple(rows), notes).without_empty_columns()


FOR_PILOTS = (
    "Levels were drawn up for piloted vehicles of full size; for a small one they describe, and "
    "require nothing."
)


def _row(what: str, quantity: Reading, rating: Rating | None, level: float) -> tuple[Cell, ...]:
    low, high = quantity.interval(level) or (None, None)
    unit = "" if quantity.unit == "1" else quantity.unit
    known = unit == "rad/s" and quantity.value is not None
    hz = float(cast("float", quantity.value)) / math.tau if known else None
    return (what, quantity.name, quantity.value, low, high, unit, hz, *_level(rating))


def _level(rating: Rating | None) -> tuple[Cell, ...]:
    if rating is None:
        return (None, None, None)
    shares = rating.probabilities
    return (rating.text, None if shares is None else 100.0 * shares[0], rating.chart.standard)


def _mode_rows(rating: Rating, level: float) -> list[tuple[Cell, ...]]:
    rows = []
    for place, quantity in enumerate(rating.quantities):
        rows.append(_row(rating.subject, quantity, rating if place == 0 else None, level))
    return rows


def handling_qualities(
    source: object,
    *,
    axes: Pairs | None = None,
    signs: Mapping[str, int] | None = None,
    vehicle: str = "rotorcraft",
    response_type: str = "rate",
    band_rad_s: tuple[float, float] = (0.1, 100.0),
    speed: str = "hover",
    task: str = "other",
    attention: str = "full",
    category: str = "A",
    aircraft_class: str = "I",
    n_alpha: float | None = None,
    charts: str | None = None,
) -> HandlingQualities:
    """What a model or a measured response says of handling qualities, with levels.

    Parameters
    ----------
    source : Fit, FrequencyResponse, model, LinearSystem, or a black-box fit
    axes : mapping of str to tuple of str, optional
        Output and control by axis (``"roll"``, ``"pitch"``, ``"yaw"``); default: phi, theta, psi,
        or p, q, r, and the control that goes by a usual name or is alone.
    signs : mapping of str to int, optional
        −1 for an axis whose control pulls the other way; left out: as the phase shows.
    vehicle : {"rotorcraft", "aeroplane"}
        By ADS-33E, or by MIL-F-8785C and MIL-STD-1797A.
    response_type : {"rate", "attitude"}
    band_rad_s : tuple of float
        Band to look for bandwidths in, rad/s.
    speed : {"hover", "forward"}
    task : {"other", "tracking"}
        Of rotorcraft: target acquisition and tracking, or all others.
    attention : {"full", "divided"}
        Full attention in good visual cues, or divided or with poor ones.
    category : {"A", "B", "C"}
    aircraft_class : {"I", "II", "II-L", "II-C", "III", "IV"}
        Of aeroplanes.
    n_alpha : float, optional
        Of aeroplanes: g/rad, for the control anticipation parameter; left out: from Zalpha, or
        from Zw and U0, of the model.
    charts : str, optional
        File of charts in place of ours.

    Returns
    -------
    HandlingQualities
        What cannot be had is a finding.

    Raises
    ------
    OptionError
        A vehicle or an axis that is not known; conditions that name no case of a chart.
    UnknownNameError
        There is no such channel.

    Assumes
    -------
    As for `attitude_bandwidth` and `modes`. Requirements on forces, large amplitudes and coupling
    are not looked at, nor attitude quickness: a linear model does not tell it.

    Reference
    ---------
    ADS-33E-PRF (2000), §3.3 and 3.4; MIL-F-8785C (1980), §3.2 and 3.3; MIL-STD-1797A (1990).

    Example
    -------
    >>> import flightid as fid
    >>> lateral = fid.load_model("fixed_wing_lateral")
    >>> found = handling_qualities(lateral, vehicle="aeroplane", category="B", axes={})
    >>> [(each.subject, each.text) for each in found.ratings]
    [('spiral', 'Level 1'), ('Dutch roll', 'Level 1'), ('roll', 'Level 1')]
    """
    if vehicle not in VEHICLES:
        raise OptionError("vehicle is not known", found=vehicle, needed=" or ".join(VEHICLES))
    conditions = (
        {"speed": speed, "task": task, "attention": attention}
        if vehicle == "rotorcraft"
        else {"category": category, "class": aircraft_class}
    )
    pairs, findings = _pairs(source, axes)
    vehicles = _made_once(source)
    bandwidths: dict[str, AttitudeBandwidth] = {}
    ratings: list[Rating] = []
    for axis, (output, control) in pairs.items():

        def bandwidth(
            sign: int, axis: str = axis, pair: tuple[str, str] = (control, output)
        ) -> Any:  # noqa: ANN401
            return attitude_bandwidth(
                vehicles,
                *pair,
                band_rad_s=band_rad_s,
                response_type=response_type,
                output_is="rate" if pair[1] == ATTITUDES[axis][1] else "attitude",
                sign=sign,
            )

        try:
            found, said = with_found_sign(axis, signs or {}, bandwidth)
        except DataError as error:
            findings.append(_absent("no-bandwidth", f"{axis}: {error.problem}", error.action or ""))
            continue
        bandwidths[axis] = found
        findings += said
        findings += _prefixed(axis, found.findings)
        ratings += _bandwidth_ratings(axis, found, vehicle, conditions, charts)
    seen = _modes(source, findings)
    if seen is not None:
        if vehicle == "aeroplane" and n_alpha is None:
            n_alpha = _slope(source, seen, findings)
        ratings += mode_ratings(
            seen, vehicle=vehicle, conditions=conditions, n_alpha=n_alpha, path=charts
        )
        rated = {rating.subject for rating in ratings} if vehicle == "aeroplane" else set()
        findings += divergence_findings(seen, rated)
    names = () if seen is None else (mode.name for mode in seen)
    findings += gaps(ratings, [*bandwidths, *names])
    findings += [finding for rating in ratings for finding in rating.findings]
    findings += source_findings(source)
    return HandlingQualities(vehicle, conditions, bandwidths, seen, tuple(ratings), tuple(findings))


def _made_once(source: object) -> object:
    """A source whose vehicles, all that its covariance allows, are made once for all axes."""
    if isinstance(source, FrequencyResponse):
        return source
    estimate = uncertain_of(source)
    # A transfer function answers by its own pairs: as one system it would be of higher order.
    is_by_pairs = isinstance(estimate.value, TransferFunctionModel)
    return source if is_by_pairs else estimate.then(linear_system).kept()


def _slope(source: object, seen: Modes, findings: list[Finding]) -> float | None:
    """n/α from the model's own derivatives, where it has a short period to rate with it."""
    if not any(mode.name == "short period" for mode in seen):
        return None
    found = load_factor_slope(source)
    if found is None:
        text = "natural frequency against n/α is not rated: the model has no Zalpha, or Zw and U0"
        findings.append(_absent("no-n-alpha", text, ASK_N_ALPHA))
        return None
    text = f"n/α {found[0]:.3g} g/rad, as {found[1]} of the model, without the elevator's lift"
    findings.append(_absent("n-alpha", text, f"{ASK_N_ALPHA}, where it is known better"))
    return found[0]


def _bandwidth_ratings(
    axis: str,
    found: AttitudeBandwidth,
    vehicle: str,
    conditions: Mapping[str, str],
    path: str | None,
) -> list[Rating]:
    if any(finding.code == "sign-doubtful" for finding in found.findings):
        return []
    if vehicle == "rotorcraft":
        chart = rating_chart("attitude_bandwidth", path=path, axis=axis, **conditions)
    elif axis == "pitch" and conditions["category"] == "A":
        chart = rating_chart("pitch_bandwidth", path=path, **conditions)
    else:
        return []
    rating = found.rate(chart)
    return [] if rating is None else [rating]


def _pairs(source: object, given: Pairs | None) -> tuple[Pairs, list[Finding]]:
    if given is not None:
        for axis in given:
            if axis not in ATTITUDES:
                raise OptionError("axis is not known", found=axis, needed=", ".join(ATTITUDES))
        return given, []
    outputs, inputs = _channels(source)
    found, missing = {}, []
    for axis, names in ATTITUDES.items():
        output = next((name for name in names if name in outputs), None)
        if output is None:
            continue
        controls = [name for name in CONTROLS[axis] if name in inputs]
        if len(inputs) == 1:
            controls = list(inputs)
        if controls:
            found[axis] = (output, controls[0])
        else:
            text = f"{axis}: none of {', '.join(inputs)} is a control by a usual name"
            missing.append(_absent("no-control", text, f"axes={{'{axis}': ('{output}', …)}}"))
    if not found and not missing:
        text = f"none of {', '.join(outputs)} is an attitude or a rate by a usual name"
        missing.append(_absent("no-attitude", text, "name output and control of each axis"))
    return found, missing


def _channels(source: object) -> tuple[Sequence[str], Sequence[str]]:
    if isinstance(source, FrequencyResponse):
        return source.outputs, source.inputs
    inner = model_of(source)
    if hasattr(inner, "outputs") and hasattr(inner, "inputs"):
        return tuple(inner.outputs), tuple(inner.inputs)
    system = linear_system(source)
    return system.outputs, system.inputs


def _modes(source: object, findings: list[Finding]) -> Modes | None:
    if isinstance(source, FrequencyResponse):
        text = "a measured response has no modes"
        findings.append(_absent("no-modes", text, "fit a model, or lower_order(kind=…), to it"))
        return None
    try:
        return modes(source)
    except ModelError as error:
        findings.append(_absent("no-modes", error.problem, error.action or ""))
        return None


def _absent(code: str, text: str, action: str) -> Finding:
    return Finding(code, Light.UNKNOWN, text, action)


def _prefixed(axis: str, findings: Sequence[Finding]) -> list[Finding]:
    """Of one axis; what is known of the source is said once."""
    return [
        Finding(f.code, f.light, f"{axis}: {f.message}", f.action)
        for f in findings
        if f.code != "source-evidence"
    ]
