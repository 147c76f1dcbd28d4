"""Models without equations on the command line: kinds, channels and orders to a structure."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.option_fields import parted
from flightid.cli.records import as_channels, read_files, reading

if TYPE_CHECKING:
    from flightid.models import NarxStructure, SubspaceStructure
    from flightid.models.polynomial.structure import PolynomialStructure
    from flightid.options import Options
    from flightid.record import Record

    Structure = PolynomialStructure | SubspaceStructure | NarxStructure

POLYNOMIALS = ("arx", "armax", "oe", "bj")
SUBSPACE, NARX = "subspace", "narx"
KINDS = (*POLYNOMIALS, SUBSPACE, NARX)
USUAL_ORDER, USUAL_DELAY = 2, 1


def black_boxes() -> dict[str, type[Options]]:
    """Options of models without equations, by what takes them."""
    from flightid.models import NarxStructure, SubspaceStructure
    from flightid.models.polynomial.orders import OrderOptions
    from flightid.models.polynomial.structure import PolynomialStructure
    from flightid.record.options import ChannelOptions

    return {
        "kinds": ChannelOptions,
        ", ".join(POLYNOMIALS): OrderOptions,
        "polynomials": PolynomialStructure,
        SUBSPACE: SubspaceStructure,
        NARX: NarxStructure,
    }


def channels_of(
    files: Sequence[Path], channels: dict[str, Any], of_files: Sequence[dict[str, Any]]
) -> tuple[list[Record], tuple[str, ...], tuple[str, ...]]:
    """Records of the files, with the inputs and outputs that were named or have these roles.

    Raises
    ------
    click.UsageError
        Nothing says which channels drive or answer.
    """
    records = read_files(files, *of_files, **channels, take="flown")
    inputs = channels.get("inputs") or records[0].inputs
    outputs = channels.get("outputs") or records[0].outputs
    if not inputs or not outputs:
        raise click.UsageError(
            f"name the channels with --inputs and --outputs; {files[0].name} holds "
            f"{', '.join(records[0].channels)}{_of_a_rate(files)}"
        )
    return records, as_channels(records[0], inputs), as_channels(records[0], outputs)


def structure_of(
    kind: str, method: str | None, files: Sequence[Path], options: dict[str, Any]
) -> tuple[Structure, list[Record]]:
    """The structure that was asked for, and the records to fit it to.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    method : str, optional
        Of that kind.
    files : sequence of Path
    options : dict of str to object
        Values of the command's options.

    Raises
    ------
    click.UsageError
        An option of another kind, several outputs where one is modelled, several orders.
    """
    from flightid.models import InnovationsModel, NarxStructure, PolynomialModel

    fields = black_boxes()
    channels, orders, *_ = fields.values()
    label = f"kind {kind}"
    if kind in POLYNOMIALS:
        wanted = {"channels": channels, "orders": orders, label: fields["polynomials"]}
    else:
        wanted = {"channels": channels, label: fields[kind]}
    injected = options.get("excitations") or ()
    rest = {name: value for name, value in options.items() if name != "excitations"}
    named, *given, of_tables, of_logs = parted(rest, {**wanted, **reading()})
    if injected:
        method = _by_excitation(kind, method)
        named["excitations"] = tuple(injected)
    if method is not None:
        given[-1]["method"] = method
    records, inputs, outputs = channels_of(files, named, (of_tables, of_logs))
    if kind == SUBSPACE:
        return InnovationsModel.subspace(inputs, outputs, **given[-1]), records
    output = only(outputs, files)
    if kind == NARX:
        if method is not None:
            raise click.UsageError("--method is no option of kind narx")
        return NarxStructure(inputs, output, **given[-1]), records
    return PolynomialModel.general(inputs, output, **one_each(kind, given[0]), **given[-1]), records


def _by_excitation(kind: str, method: str | None) -> str:
    """The method by which a kind is fitted by way of what was injected.

    Raises
    ------
    click.UsageError
        The kind has none, or another method was asked for.
    """
    from flightid.models.polynomial.structure import BY_EXCITATION

    own = BY_EXCITATION.get(kind.upper())
    ways = ", ".join(f"{each.lower()} (method {way})" for each, way in BY_EXCITATION.items())
    if own is None:
        raise click.UsageError(
            f"--excitation serves kinds {ways}; {kind} has a noise model of its own, so that a "
            "loop does not bias it where that is large enough: leave --excitation out"
        )
    if method not in (None, own):
        raise click.UsageError(
            f"--excitation serves method {own} of kind {kind}; found --method {method}"
        )
    return own


def only(outputs: Sequence[str], files: Sequence[Path] = ()) -> str:
    """The one output of the files.

    Raises
    ------
    click.UsageError
        There are several.
    """
    if len(outputs) != 1:
        raise click.UsageError(
            f"name one output with --outputs; found {', '.join(outputs)}{_of_a_rate(files)}"
        )
    return outputs[0]


def _of_a_rate(files: Sequence[Path]) -> str:
    """How a rate of a flight and its command are named; empty of other records."""
    from flightid.inspection.axes import axes_of
    from flightid.logs import is_log, read_log

    log = next((each for each in files if each.is_file() and is_log(each)), None)
    if log is None:
        return ""
    roll = axes_of(read_log(log).vehicle)["roll"]
    return f". The roll rate and its command: --inputs {roll.command} --outputs {roll.rate}"


def one_each(kind: str, orders: dict[str, Any]) -> dict[str, Any]:
    """One number for each order of a kind; those that were not given have the usual one.

    Raises
    ------
    click.UsageError
        Several numbers, or an order that the kind does not have.
    """
    from flightid.models.polynomial.orders import USED

    made: dict[str, Any] = {
        name: USUAL_DELAY if name == "nk" else USUAL_ORDER for name in USED[kind]
    }
    for name, values in orders.items():
        if name not in made:
            raise click.UsageError(f"--{name} is no order of {kind}; it has {', '.join(made)}")
        if len(values) != 1:
            raise click.UsageError(f"--{name} takes one number; several are for a scan of orders")
        made[name] = values[0]
    return made
