"""Parameters in words: what a row of the catalogue and a line of the page call them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping

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


def told_apart(meanings: Mapping[str, str | None]) -> dict[str, str]:
    """Words of parameters by name; where several would read alike, each has its name behind.

    Parameters
    ----------
    meanings : mapping of str to str or None
        What the catalogue says of each; None: by its usual name, if it has one.

    Example
    -------
    >>> told_apart({"Lp": None, "k1": "stiffness", "k2": "stiffness", "k3": None})
    {'Lp': 'roll damping', 'k1': 'stiffness (k1)', 'k2': 'stiffness (k2)'}
    """
    words = {name: said or meaning(name) for name, said in meanings.items()}
    counts = Counter(words.values())
    return {
        name: said if counts[said] == 1 else f"{said} ({name})"
        for name, said in words.items()
        if said
    }
