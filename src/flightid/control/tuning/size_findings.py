"""Answers that hang on the size of the motion, and what gains have to carry of it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from flightid.control.tuning.structure_error import Band
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.identification.answers_of_records import by_size_of
from flightid.identification.fit import Fit

BY_SIZE = "answer-by-size"
MATTERS = 0.05
"""Share of a response, within the band, from which on margins feel it: 3 degrees."""


def answers_by_size(source: object, pairs: Sequence[str], band: Band | None) -> Iterator[Finding]:
    """Amber where a response of the axes hangs on the size of the motion beyond chance.

    Plants are moved by what small motion may differ by (`errors_of`).

    Parameters
    ----------
    source : fit or model
    pairs : sequence of str
        ``"output/input"`` of the axes.
    band : tuple of float or None
        Identified band, rad/s.
    """
    if not isinstance(source, Fit) or band is None:
        return
    for name, found in by_size_of(source).items():
        inside = (found.omega_rad_s >= band[0]) & (found.omega_rad_s <= band[1])
        if name not in pairs or not inside.any():
            continue
        place = np.flatnonzero(inside)[np.argmax(found.share[inside])]
        most = float(found.share[place])
        yield Finding(
            BY_SIZE,
            Light.AMBER if most > MATTERS else Light.GREEN,
            f"{name}: the answer depends on the size of the motion ({found.ratio:.2g} standard "
            f"errors): smaller motion may answer by up to {100.0 * most:.2g} % otherwise, most at "
            f"{found.omega_rad_s[place]:.3g} rad/s (drag, friction, motors that are no straight "
            "line); plants reach that",
            "record motion as small as it will be flown" if most > MATTERS else "",
        )
