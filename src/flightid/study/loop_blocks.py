"""Blocks of a controller in a study file: the functions of `flightid.loops` as data."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from flightid.control import loops
from flightid.control.laws.augmentation import augmentation_law
from flightid.control.stepped.block_controller import BlockController
from flightid.errors import StudyError, UnitError, UnknownNameError

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


def law_controller(
    law: str | Path | Mapping[str, Any],
    model: Any,  # noqa: ANN401 — its channels are all that is asked of it
    sample_time_s: float,
) -> BlockController:
    """An augmentation law around a model, one frame at a time.

    Parameters
    ----------
    law : str, path-like or mapping
        As `augmentation_law` takes it.
    model : Model or LinearSystem
    sample_time_s : float
        Of a frame, s.

    Raises
    ------
    OptionError
        There is no such law.
    UnknownNameError
        The law moves or reads what the model has not.
    UnitError
        The model has it in another unit: gains hold for theirs alone.

    Example
    -------
    >>> from flightid import load_model
    >>> law_controller("dase", load_model("ah64_hover"), 0.01).commands
    ()
    """
    made = augmentation_law(law)
    for kind, needed, there in (
        ("input", [axis.input for axis in made.axes], model.inputs),
        ("output", made.sensors, model.outputs),
    ):
        if missing := [name for name in needed if name not in there]:
            raise UnknownNameError(
                f"the law {made.name!r} needs an {kind} that the model has not",
                found=", ".join(missing),
                needed=f"of {', '.join(there)}",
                action="write a law with [[axis]] tables for this model's channels",
            )
    for axis in made.axes:
        read = {axis.input: axis.unit, axis.rate: "rad/s"}
        read |= {axis.attitude: "rad"} if axis.attitude else {}
        for name, unit in read.items():
            if (found := model.units.get(name, unit)) != unit:
                raise UnitError(f"{name!r} of the law {made.name!r}", found=found, needed=unit)
    blocks = [made_block(table, made.name) for table in made.tables()]
    return BlockController(blocks, model, sample_time_s)
