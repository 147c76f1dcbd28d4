"""Parameters in words: what a row of the catalogue and a line of the page call them."""

from __future__ import annotations

import re

AXES = {"phi": "roll", "theta": "pitch", "psi": "yaw"}
RATES = {"p": "roll", "q": "pitch", "r": "yaw"}
MOMENTS = {"L": "roll", "M": "pitch", "N": "yaw"}
CONTROL = re.compile(r"([LMN])t(phi|theta|psi)")
DAMPING = re.compile(r"([LMN])([pqr])")
LAGS = {"T_m": "motor lag", "tau": "delay"}
LONGEST = 40
"""Characters of a model's own note that still is a name."""


def meaning(name: str, note: str = "") -> str | None:
    """A parameter in words, by its usual name or else by its model's own note.

    Parameters
    ----------
    name : str
    note : str
        Of the model; its first clause counts where it is short.

    Returns
    -------
    str or None
        None where neither tells.

    Example
    -------
    >>> meaning("Ltphi"), meaning("Mq"), meaning("T_m"), meaning("Lq")
    ('roll control power', 'pitch damping', 'motor lag', 'roll moment by pitch rate')
    >>> meaning("k1", "stiffness of the arm; measured"), meaning("k2")
    ('stiffness of the arm', None)
    """
    if name in LAGS:
        return LAGS[name]
    if (found := CONTROL.fullmatch(name)) is not None:
        moment, axis = MOMENTS[found[1]], AXES[found[2]]
        return f"{axis} control power" if moment == axis else f"{moment} moment by {axis} control"
    if (found := DAMPING.fullmatch(name)) is not None:
        moment, axis = MOMENTS[found[1]], RATES[found[2]]
        return f"{axis} damping" if moment == axis else f"{moment} moment by {axis} rate"
    clause = re.split(r"[;,.(]", note, maxsplit=1)[0].strip()
    return clause if 0 < len(clause) <= LONGEST else None
