"""Blocks of a controller in a study file: the functions of `flightid.loops` as data."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Any

from flightid.control import loops
from flightid.errors import StudyError

KINDS = {
    make.__name__: make
    for make in (
        loops.complementary,
        loops.delay,
        loops.gain,
        loops.high_pass,
        loops.lead_lag,
        loops.limiter,
        loops.low_pass,
        loops.notch,
        loops.rate_limiter,
        loops.sample_and_hold,
        loops.sum_of,
        loops.transfer,
        loops.washout,
    )
}
"""Blocks that numbers and names of signals describe."""


def made_block(entry: Mapping[str, Any], where: str = "study file, [[loop.block]]") -> loops.Block:
    """The block that a table ``[[loop.block]]`` describes.

    Parameters
    ----------
    entry : mapping
        ``kind``, and the arguments of that function by name.
    where : str
        How a message names the table.

    Raises
    ------
    StudyError
        There is no such kind, or it does not take these arguments.
    ModelError, OptionError
        A value does not fit; as the function says.

    Example
    -------
    >>> made_block({"kind": "low_pass", "inputs": "p", "outputs": "p_f", "corner_rad_s": 60.0})
    Block(low-pass: [p] to [p_f])
    """
    given = dict(entry)
    kind = given.pop("kind", None)
    if kind not in KINDS:
        raise StudyError(
            f"{where}: there is no such kind",
            found=repr(kind),
            needed="one of " + ", ".join(KINDS),
        )
    make = KINDS[kind]
    terms = given.pop("terms", ()) if kind == loops.sum_of.__name__ else ()
    try:
        if terms:
            return loops.sum_of(given.pop("outputs"), *terms, **given)
        inspect.signature(make).bind(**given)
    except (KeyError, TypeError) as error:
        raise StudyError(
            f"{where} of kind {kind!r}: its keys do not fit",
            found=str(error),
            needed=", ".join(inspect.signature(make).parameters),
        ) from error
    return make(**given)
