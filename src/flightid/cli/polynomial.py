"""``flightid polynomial``: black-box models from records, or a scan of their orders."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from flightid.cli.output import emit, json_option, leave_by_verdict, note

if TYPE_CHECKING:
    from flightid.record import Record

ORDERS = ("na", "nb", "nc", "nd", "nf")
HIGHEST = {"na": 4, "nb": 4, "nc": 3, "nd": 2, "nf": 4}


@click.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--output", help="Channel to model; default: the only output.")
@click.option(
    "--input", "inputs", multiple=True, help="Channel that drives it; repeat for several."
)
@click.option(
    "--kind",
    type=click.Choice(["arx", "armax", "oe", "bj"]),
    default="armax",
    show_default=True,
)
@click.option("--na", type=click.IntRange(0), help="Degree of A; with --scan the highest.")
@click.option("--nb", type=click.IntRange(0), help="Coefficients of B.")
@click.option("--nc", type=click.IntRange(0), help="Degree of C.")
@click.option("--nd", type=click.IntRange(0), help="Degree of D.")
@click.option("--nf", type=click.IntRange(0), help="Degree of F.")
@click.option("--nk", type=click.IntRange(0), default=1, show_default=True, help="Delay, samples.")
@click.option("--scan", is_flag=True, help="Try all orders from 1 and all delays from 1.")
@click.option(
    "--validate",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="File of records that the fit does not see.",
)
@click.option(
    "--initial-state",
    type=click.Choice(["estimate", "zero"]),
    default="estimate",
    show_default=True,
)
@click.option("--backcast", is_flag=True, help="Estimate the past of each record backwards.")
@json_option
def command(
    file: Path,
    output: str | None,
    inputs: tuple[str, ...],
    kind: str,
    na: int | None,
    nb: int | None,
    nc: int | None,
    nd: int | None,
    nf: int | None,
    nk: int,
    scan: bool,
    validate: Path | None,
    initial_state: str,
    backcast: bool,
    as_json: bool,
) -> None:
    """Fit a polynomial model to the records of FILE, or scan its orders.

    The exit code is 1 where a verdict is red.
    """
    import flightid

    given = dict(zip(ORDERS, (na, nb, nc, nd, nf), strict=True))
    records = _records(file, output, inputs)
    unseen = [] if validate is None else _records(validate, output, inputs)
    name = output or _only(records)
    names = inputs or records[0].inputs
    if scan:
        if not unseen:
            raise click.UsageError("--scan ranks by free run: name unseen records with --validate")
        ranges = {k: range(1, (HIGHEST[k] if v is None else v) + 1) for k, v in given.items()}
        found = flightid.scan_orders(
            records,
            unseen,
            outputs=name,
            inputs=names,
            kind=kind,
            na=ranges["na"],
            nb=ranges["nb"],
            nc=ranges["nc"],
            nd=ranges["nd"],
            nf=ranges["nf"],
            nk=range(1, nk + 1),
            initial_state=initial_state,
            backcast=backcast,
        )
        emit(found, as_json=as_json)
        leave_by_verdict(found.findings)
        return
    used = {"arx": ("na", "nb"), "armax": ("na", "nb", "nc"), "oe": ("nb", "nf")}
    wanted = used.get(kind, ("nb", "nc", "nd", "nf"))
    orders = {key: 2 if given[key] is None else given[key] or 0 for key in wanted}
    structure = flightid.PolynomialModel.general(
        names,
        name,
        na=orders.get("na", 0),
        nb=orders.get("nb", 0),
        nc=orders.get("nc", 0),
        nd=orders.get("nd", 0),
        nf=orders.get("nf", 0),
        nk=nk,
        initial_state=initial_state,
        backcast=backcast,
    )
    fit = flightid.identify(structure, records)
    note(repr(fit))
    for record in unseen:
        note(f"{record.name}: {flightid.predict(fit, record)!r}")
    emit(fit, as_json=as_json)
    leave_by_verdict((*fit.findings, *fit.evidence.findings))


def _records(file: Path, output: str | None, inputs: tuple[str, ...]) -> list[Record]:
    import flightid

    return flightid.read_records(
        file, inputs=list(inputs) or None, outputs=None if output is None else [output]
    )


def _only(records: list[Record]) -> str:
    outputs = records[0].outputs
    if len(outputs) != 1:
        raise click.UsageError(f"name the output with --output; found {', '.join(outputs)}")
    return outputs[0]
