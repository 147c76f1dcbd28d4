"""What levels do not say: divergences, the load factor by angle of attack, signs, and gaps."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping

from flightid.conventions import STANDARD_GRAVITY_M_S2, Light
from flightid.dynamics.handling_qualities.rating import Rating
from flightid.dynamics.handling_qualities.result import AttitudeBandwidth
from flightid.dynamics.modes.result import Mode
from flightid.errors import DataError
from flightid.findings import Finding
from flightid.models.model import model_of
from flightid.units import conversion_factor

DOUBTFUL = "sign-doubtful"
TOLERATED = ("spiral", "phugoid")
"""Modes for whose growth standards of aeroplanes have limits of their own."""
ASK_N_ALPHA = "say n_alpha=… (g/rad)"


def divergence_findings(modes: Iterable[Mode], rated: Collection[str]) -> list[Finding]:
    """Modes that grow and that no chart has rated, with the time in which they double.

    Parameters
    ----------
    modes : iterable of Mode
    rated : collection of str
        Names of modes that a chart of growth has rated.

    Returns
    -------
    list of Finding
        Red: outside the limits for spirals and phugoids, standards allow no divergence.

    Reference
    ---------
    MIL-F-8785C (1980), §3.2.1.1; ADS-33E-PRF (2000), §3.3.2.3.
    """
    found = []
    for mode in modes:
        time = mode.time_to_double
        if mode.eigenvalue is None or time.value is None or mode.eigenvalue.real <= 0.0:
            continue
        if mode.name in TOLERATED and mode.name in rated:
            continue
        kind = "grows in oscillations" if mode.is_pair else "diverges"
        text = f"{mode.name} {kind}: time to double {time.text}"
        action = "such a vehicle flies with feedback alone: rate it with its loop closed"
        found.append(Finding("divergence", Light.RED, text, action))
    return found


def load_factor_slope(source: object) -> tuple[float, str] | None:
    """n/α of an aeroplane's model in g/rad, and from what; None where it has no such derivative.

    At constant speed, without the lift of the elevator: −Zα/g, or −Zw U₀/g.

    Parameters
    ----------
    source : model or Fit

    Returns
    -------
    tuple of (float, str), or None

    Assumes
    -------
    Derivatives by mass. The lift of the elevator is left out: biased by its share, some percent.

    Reference
    ---------
    MIL-F-8785C (1980), §3.2.2.1.1 and §6.2; Nelson, *Flight Stability and Automatic Control*,
    2nd ed., section 4.4.

    Example
    -------
    >>> import flightid as fid
    >>> value, words = load_factor_slope(fid.load_model("short_period"))
    >>> round(value, 2), words
    (11.07, '-Zalpha/g')
    """
    parameters = getattr(model_of(source), "parameters", None)
    known = {} if parameters is None else {p.name.lower(): p for p in parameters.values()}

    def number(name: str, unit: str) -> float | None:
        parameter = known.get(name)
        if parameter is None or parameter.value is None:
            return None
        return float(parameter.value) * conversion_factor(parameter.unit, unit)

    try:
        force = number("zalpha", "m/s^2")
        words = "-Zalpha/g"
        if force is None:
            heave, speed = number("zw", "1/s"), number("u0", "m/s")
            force = None if heave is None or speed is None else heave * speed
            words = "-Zw*U0/g"
    except ValueError:
        return None
    if force is None or force >= 0.0:
        return None
    return -force / STANDARD_GRAVITY_M_S2, words


def with_found_sign(
    axis: str, told: Mapping[str, int], work: Callable[[int], AttitudeBandwidth]
) -> tuple[AttitudeBandwidth, tuple[Finding, ...]]:
    """Bandwidth of an axis with the sign it was told, else with the one that its phase shows.

    Parameters
    ----------
    axis : str
    told : mapping of str to int
        Signs by axis.
    work : callable
        Bandwidth for a sign.

    Returns
    -------
    AttitudeBandwidth, and tuple of Finding

    Raises
    ------
    DataError
        There is no bandwidth with either sign.
    """
    if axis in told:
        return work(told[axis]), ()
    failure, first = None, None
    try:
        first = work(1)
        if not _doubtful(first):
            return first, ()
    except DataError as error:
        failure = error
    try:
        other = work(-1)
    except DataError:
        other = None
    if other is not None and not _doubtful(other):
        text = f"{axis}: the control pulls the other way, by the phase of its response: taken so"
        action = f"signs: {{'{axis}': 1}} or -1 tells it, in a study [handling_qualities.signs]"
        light = Light.AMBER if other.curve.branch.above else Light.GREEN
        return other, (Finding("sign-found", light, text, action),)
    if first is None:
        assert failure is not None
        raise failure
    return first, ()


def gaps(ratings: Iterable[Rating], what: Iterable[str]) -> list[Finding]:
    """A finding where nothing at all was rated.

    Parameters
    ----------
    ratings : iterable of Rating
    what : iterable of str
        What was looked at.
    """
    if list(ratings):
        return []
    looked = ", ".join(what) or "no axis and no mode"
    return [
        Finding(
            "no-level",
            Light.UNKNOWN,
            f"no requirement of the standard could be rated; looked at {looked}",
            "name axes and signs, widen band_rad_s, or rate a model of the whole axis",
        )
    ]


def _doubtful(found: AttitudeBandwidth) -> bool:
    return any(finding.code == DOUBTFUL for finding in found.findings)
