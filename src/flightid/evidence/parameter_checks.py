"""Whether estimates keep the signs that their bounds declare."""

from __future__ import annotations

from collections.abc import Mapping

from flightid.conventions import Light
from flightid.evidence.evidence import SIGNS, Check

Signed = tuple[int, float, tuple[float, float] | None, str]
WORDS = {1: "positive", -1: "negative"}


def declared_signs(parameters: Mapping[str, Signed]) -> Check:
    """Judge parameters whose bounds leave one sign.

    A fit keeps its bounds, so a sign is in doubt where the estimate ended at zero or where its
    interval reaches beyond it.

    Parameters
    ----------
    parameters : mapping of str to (sign, value, interval or None, status)

    Example
    -------
    >>> declared_signs({"Lp": (-1, -2.0, (-5.0, 1.0), "free")}).light.value
    'amber'
    """
    doubtful = []
    for name, (sign, value, interval, status) in parameters.items():
        beyond = interval is not None and sign * (interval[0] if sign > 0 else interval[1]) <= 0.0
        if sign * value <= 0.0 or (status == "at bound" and abs(value) == 0.0) or beyond:
            doubtful.append(f"{name} (declared {WORDS[sign]})")
    if not doubtful:
        names = ", ".join(parameters)
        return Check(SIGNS, Light.GREEN, f"declared signs hold: {names}")
    return Check(
        SIGNS,
        Light.AMBER,
        f"the data do not tell the declared sign of {', '.join(doubtful)}",
        "fix the parameter, or excite what it belongs to",
    )
