"""Formulas of a log's fields, in the grammar of derived columns of records and of models."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.dimensions import unit_of
from flightid.errors import DataError, ModelError, OptionError
from flightid.formula import formula_names
from flightid.frozen import dataclass
from flightid.logs.log import Log
from flightid.logs.log_table import LogTable
from flightid.record.derived import in_words
from flightid.units import conversion_factor, is_convertible

FIELD = re.compile(r"([^.\[\]]{1,200})(?:\[(\d{1,4})\])?\.(.{1,200})")
"""MESSAGE.FIELD, or MESSAGE[instance].FIELD."""
LONGEST = 500
"""Letters of a formula."""


@dataclass(frozen=True, eq=False)
class FieldFormula:
    """What a formula makes of fields.

    Attributes
    ----------
    fields : tuple of str
        Those that it names, as MESSAGE.FIELD.
    time_s, values : ndarray, shape (n,)
        On the stamps of the first of them, s; NaN where a number is missing or none comes out.
    unit : str
    """

    fields: tuple[str, ...]
    time_s: NDArray[np.float64]
    values: NDArray[np.float64]
    unit: str


def field_formula(log: Log, formula: str) -> FieldFormula:
    """Work out a formula of fields over the whole log.

    Parameters
    ----------
    log : Log
    formula : str
        Such as ``RCOU.C1 + RCOU.C4 - RCOU.C2 - RCOU.C3``; of a message with several instances
        ``ESC[0].RPM``. Fields of other messages are read by straight lines between their samples.

    Returns
    -------
    FieldFormula

    Raises
    ------
    OptionError
        No formula of the grammar, of no field, or of units that do not go together.
    UnknownNameError
        The log holds no such message or field.

    Example
    -------
    >>> import flightid as fid
    >>> log = fid.read_log("flight.bin")                             # doctest: +SKIP
    >>> field_formula(log, "ATT.Roll - ATT.DesRoll").unit            # doctest: +SKIP
    'deg'
    """
    words, fields, compiled = _compiled(formula)
    read = {word: _column(log, field) for word, field in fields.items()}
    known = {word: table.unit(name) for word, (table, name) in read.items()}
    try:
        unit = unit_of(words, known, subject=f"formula {formula!r}")
    except ModelError as fault:
        raise OptionError(
            f"the formula does not have one unit: {formula!r}",
            found=fault.found,
            needed=fault.needed,
            action="scale one of its fields, as in 0.01745 * ATT.Roll / 1",
        ) from fault
    # A sum of one unit has that unit: radians, which count as plain numbers, would be lost.
    shared = {*known.values()}
    if (
        len(shared) == 1
        and is_convertible(unit, *shared)
        and conversion_factor(unit, *shared) == 1.0
    ):
        (unit,) = shared
    time_s = next(iter(read.values()))[0].time_s
    rows = np.stack([_on(time_s, *each) for each in read.values()], axis=1)
    return FieldFormula(tuple(fields.values()), time_s, _worked_out(compiled, rows), unit)


def require_formula(formula: str) -> None:
    """Refuse what is no formula of fields, without a log.

    Raises
    ------
    OptionError
        No formula of the grammar, or of no field.
    """
    _compiled(formula)


def _compiled(formula: str) -> tuple[str, dict[str, str], _native.Tape]:
    """Its words, the field of each, and what works it out."""
    try:
        if len(formula) > LONGEST:
            raise ModelError("a formula is too long", found=f"{len(formula)} letters")
        words, columns = in_words(formula)
        names = list(dict.fromkeys(formula_names(words)))
        compiled = _native.Tape([words], names, {})
    except ModelError as fault:
        raise OptionError(
            f"this is no formula of fields: {formula[:LONGEST]!r} {fault}",
            needed="MESSAGE.FIELD, numbers, + - * / ^ and functions such as abs or where",
        ) from fault
    bare = [name for name in names if name not in columns]
    if bare or not names:
        raise OptionError(
            "a formula names its fields with their message",
            found=", ".join(bare) or "no field",
            needed="MESSAGE.FIELD, for example ATT.Roll",
        )
    return words, {name: columns[name] for name in names}, compiled


def _column(log: Log, field: str) -> tuple[LogTable, str]:
    match = FIELD.fullmatch(field)
    if match is None:
        raise OptionError("this names no field", found=field, needed="MESSAGE.FIELD")
    message, number, name = match.groups()
    table = log.table(message, None if number is None else int(number))
    table.unit(name)
    return table, name


def _on(time_s: NDArray[np.float64], table: LogTable, name: str) -> NDArray[np.float64]:
    """A field at the stamps of another; NaN ahead of its first sample and after its last."""
    values = np.asarray(table[name], np.float64)
    if table.time_s is time_s or np.array_equal(table.time_s, time_s):
        return values
    made: NDArray[np.float64] = np.interp(time_s, table.time_s, values, left=np.nan, right=np.nan)
    return made


def _worked_out(compiled: _native.Tape, rows: NDArray[np.float64]) -> NDArray[np.float64]:
    made = np.full(len(rows), np.nan)
    for place in np.flatnonzero(np.isfinite(rows).all(axis=1)):
        try:
            made[place] = compiled.evaluate(rows[place])[0]
        except DataError:  # such as 0 / 0: a gap
            continue
    return made
