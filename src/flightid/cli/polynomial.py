"""``flightid polynomial``: black-box models from records, or a scan of orders and kinds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.black_boxes import channels_of, one_each, only
from flightid.cli.lists import ListOption
from flightid.cli.option_fields import OptionsCommand, parted
from flightid.cli.output import all_option, emit, json_option, leave_by_verdict, level_option, note
from flightid.cli.pages import html_option, model_file_option, write_page
from flightid.cli.records import FILES, FilesArgument, read_files, reading
from flightid.conventions import Light

if TYPE_CHECKING:
    from flightid.options import Options

HIGHEST = {"na": 4, "nb": 4, "nc": 3, "nd": 2, "nf": 4}


def _fields() -> dict[str, type[Options]]:
    from flightid.models.polynomial.orders import ScanOptions
    from flightid.models.polynomial.structure import PolynomialStructure
    from flightid.record.options import ChannelOptions

    return {
        "channels": ChannelOptions,
        "orders": ScanOptions,
        "the fit": PolynomialStructure,
        **reading(),
    }


@click.command(cls=OptionsCommand, fields_of=_fields)
@click.argument("files", cls=FilesArgument, type=FILES, nargs=-1, required=True)
@click.option(
    "--scan",
    is_flag=True,
    help="Try the orders that are repeated; of one that is given once all up to it. Delays "
    "that are not given are about those that the records tell.",
)
@click.option(
    "--validation",
    cls=ListOption,
    type=FILES,
    multiple=True,
    help="File of records that the fit does not see.",
)
@model_file_option
@level_option
@html_option
@all_option
@json_option
def command(
    files: tuple[Path, ...],
    scan: bool,
    validation: tuple[Path, ...],
    written: Path | None,
    level: float | None,
    html: Path | None,
    as_json: bool,
    **options: Any,  # noqa: ANN401 — read from the fields
) -> None:
    """Fit a polynomial model to the records of FILES, or scan its orders.

    --scan --kind any ranks every kind, subspace and NARX too, by free run of the unseen records.

    The exit code is 1 where a verdict is red.
    """
    import flightid
    from flightid.uncertainty.quantiles import showing

    named, orders, given, *of_files = parted(options, _fields())
    kind = orders.pop("kind", "armax")
    records, inputs, outputs = channels_of(files, named, of_files)
    output = only(outputs)
    columns = {"inputs": inputs, "outputs": outputs} | named
    unseen = read_files(validation, *of_files, **columns)
    if scan:
        if not unseen:
            raise click.UsageError("--scan ranks by free run: name unseen records by --validation")
        from flightid.identification.advice.delays import delays_to_scan
        from flightid.models.polynomial.orders import ANY, EVERY_ORDER

        tried: dict[str, Any] = {
            name: _tried(orders.get(name, (most,))) for name, most in HIGHEST.items()
        }
        if kind == ANY:
            tried |= {name: each for name, each in EVERY_ORDER.items() if name not in orders}
        tried["nk"] = (
            _tried(orders["nk"]) if "nk" in orders else delays_to_scan(records, inputs, output)
        )
        scanned = flightid.scan_orders(
            records, unseen, inputs=inputs, outputs=output, kind=kind, **tried, **given
        )
        emit(scanned, as_json=as_json, level=level)
        fit, findings = scanned.best, scanned.findings
        # The table of a scan tells of none of its fits; the exit code heeds the best one's.
        for each in (each for each in fit.evidence.findings if each.light is Light.RED):
            note(f"The best, of itself: {each}")
    elif kind == "any":
        raise click.UsageError("--kind any ranks kinds: add --scan and --validation")
    else:
        structure = flightid.PolynomialModel.general(
            inputs, output, **one_each(kind, orders), **given
        )
        fit = flightid.identify(structure, records)
        findings = fit.findings
        note(repr(fit))
        for record in unseen:
            note(f"{record.name}: {flightid.predict(fit, record)!r}")
        emit(fit, as_json=as_json, level=level)
    if written is not None:
        note(f"Wrote {flightid.write_model(fit, written)}")
    if html is not None:
        with showing(level):
            note(f"Wrote {write_page(fit, fit.model.name, html)}")
    leave_by_verdict((*findings, *fit.evidence.findings))


def _tried(values: tuple[int, ...]) -> tuple[int, ...]:
    """Orders of a scan: one number stands for all from 1 up to it, or for itself where it is 0."""
    return values if len(values) > 1 else tuple(range(min(1, values[0]), values[0] + 1))
