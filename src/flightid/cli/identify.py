"""``flightid identify``: a model from logs or records, with its intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.black_boxes import KINDS, black_boxes, structure_of
from flightid.cli.equations import equations, fits_of
from flightid.cli.figures import FIGURE
from flightid.cli.lists import ListOption
from flightid.cli.log_parts import inspections_of, with_inspections
from flightid.cli.option_fields import OptionsCommand
from flightid.cli.output import all_option, emit, json_option, leave_by_verdict, level_option, note
from flightid.cli.pages import html_option, model_file_option, write_page
from flightid.cli.records import FILES, FilesArgument, reading
from flightid.cli.sources import AXES, known_methods, known_models

if TYPE_CHECKING:
    from flightid.identification import Fit, Reduction
    from flightid.inspection import Inspection
    from flightid.options import Options


def _fields() -> dict[str, type[Options]]:
    return {**equations(), **black_boxes(), **reading()}


@click.command(cls=OptionsCommand, fields_of=_fields)
@click.argument("files", cls=FilesArgument, type=FILES, nargs=-1, required=True)
@click.option(
    "--model",
    "model_name",
    shell_complete=known_models,
    help="Library name or .toml file of a model's equations.",
)
@click.option("--kind", type=click.Choice(KINDS), help="Or: the kind of a model without equations.")
@click.option("--axis", type=AXES, help="Of a library model.")
@click.option(
    "--method",
    shell_complete=known_methods,
    help="How the model is fitted. With --model: frequency_domain (default) to an estimated "
    "response; output_error, filter_error and others straight to the records; joint to both. "
    "With --kind: its own, for example iv4 of arx, n4sid of subspace.",
)
@click.option(
    "--records",
    cls=ListOption,
    type=FILES,
    multiple=True,
    help="Of method joint: records fitted beside the response of FILES, best of another flight.",
)
@click.option("--records-span-s", nargs=2, type=FIGURE, help="Part of --records, s.")
@click.option(
    "--reduce", "reduced", is_flag=True, help="Drop the parameters that the data do not determine."
)
@model_file_option
@level_option
@html_option
@all_option
@json_option
def command(
    files: tuple[Path, ...],
    model_name: str | None,
    kind: str | None,
    axis: str | None,
    method: str | None,
    records: tuple[Path, ...],
    records_span_s: tuple[float, float] | None,
    reduced: bool,
    written: Path | None,
    level: float | None,
    html: Path | None,
    as_json: bool,
    **options: Any,  # noqa: ANN401 — read from the fields of the method's options
) -> None:
    """Identify a model from FILES, logs or tables of records.

    A model with equations is named by --model, one without by --kind. The exit code is 1 where a
    verdict is red.
    """
    import flightid
    from flightid.progress import progress
    from flightid.uncertainty.quantiles import showing

    if (model_name is None) == (kind is None):
        from flightid.logs import is_log

        logs = [quote(str(each)) for each in files if each.is_file() and is_log(each)]
        whole = (
            f"; flightid run {logs[0]} chooses them and the data of a log itself" if logs else ""
        )
        raise click.UsageError(
            f"name a model with equations by --model, or a --kind without{whole}"
        )
    with progress(3, "Identifying") as advance:
        if kind is not None:
            loop = options.pop("loop", None)
            structure, data = structure_of(kind, method, files, options)
            advance()
            fit = flightid.identify(structure, data, loop=loop)
        else:
            fits, data = fits_of(
                [str(model_name)], axis, method, files, options,
                beside=records, beside_span_s=records_span_s,
            )  # fmt: skip
            (fit,) = fits.values()
        advance()
        result = flightid.reduce(fit, data) if reduced else fit
        result = _with_inspection(result, inspections_of(files))
        advance()
    note(repr(result))
    if isinstance(result, flightid.Reduction) and not as_json:
        emit(result.fit, as_json=False, level=level)
    emit(result, as_json=as_json, level=level)
    found = result.fit if isinstance(result, flightid.Reduction) else result
    if written is not None:
        note(f"Wrote {flightid.write_model(found, written)}")
    if html is not None:
        with showing(level):
            note(f"Wrote {write_page(found, found.model.name, html)}")
    leave_by_verdict((*result.findings, *found.evidence.findings))


def _with_inspection(result: Fit | Reduction, inspections: Sequence[Inspection]) -> Fit | Reduction:
    """The fit, or every fit of a reduction, with the verdicts on its logs among its evidence."""
    import flightid

    if not isinstance(result, flightid.Reduction):
        return with_inspections(result, inspections)
    path = tuple(
        step if step.fit is None else replace(step, fit=with_inspections(step.fit, inspections))
        for step in result.path
    )
    return replace(result, start=with_inspections(result.start, inspections), path=path)
