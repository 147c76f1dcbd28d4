"""``flightid identify``: a model from logs or records, with its intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.black_boxes import KINDS, black_boxes, structure_of
from flightid.cli.option_fields import OptionsCommand, parted
from flightid.cli.output import all_option, emit, json_option, leave_by_verdict, level_option, note
from flightid.cli.pages import html_option, write_page
from flightid.cli.records import FILES, read_files, reading
from flightid.cli.sources import AXES, known_models

if TYPE_CHECKING:
    from flightid.identification import Fit, Reduction
    from flightid.options import Options

ON_RESPONSES, JOINT = "frequency_domain", "joint"


def _fields() -> dict[str, type[Options]]:
    return {"responses": _of_responses(), **_methods(), **black_boxes(), **reading()}


@click.command(cls=OptionsCommand, fields_of=_fields)
@click.argument("files", type=FILES, nargs=-1, required=True)
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
    help="How the model is fitted. With --model: frequency_domain (default) to an estimated "
    "response; output_error, filter_error and others straight to the records; joint to both. "
    "With --kind: its own, for example iv4 of arx, n4sid of subspace.",
)
@click.option(
    "--records",
    type=FILES,
    multiple=True,
    help="Of method joint: records fitted beside the response of FILES, best of another flight.",
)
@click.option("--records-span-s", nargs=2, type=float, help="Part of --records, s.")
@click.option(
    "--reduce", "reduced", is_flag=True, help="Drop the parameters that the data do not determine."
)
@click.option(
    "--write",
    "written",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Model file (.toml) to write: estimates with covariance and evidence.",
)
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
    from flightid.logs import is_log
    from flightid.progress import progress
    from flightid.uncertainty.quantiles import showing

    if (model_name is None) == (kind is None):
        raise click.UsageError("name a model with equations by --model, or a --kind without")
    beside = {"records": records, "span_s": records_span_s}
    loop = options.pop("loop", None)
    with progress(3, "Identifying") as advance:
        if kind is not None:
            structure, read = structure_of(kind, method, files, options)
            data: Any = read
            advance()
            fit = flightid.identify(structure, data, loop=loop)
        else:
            fit, data = _with_equations(str(model_name), axis, method, files, beside, options, loop)
        advance()
        result = flightid.reduce(fit, data) if reduced else fit
        for log in filter(is_log, files):
            result = _with_inspection(result, log)
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


def _with_equations(
    name: str,
    axis: str | None,
    method: str | None,
    files: Sequence[Path],
    beside: dict[str, Any],
    options: dict[str, Any],
    loop: Any,  # noqa: ANN401 — open or closed, as the parser has checked
) -> tuple[Fit, Any]:
    """Fit of a model with equations, and the data that it was fitted to."""
    import flightid
    from flightid.models import load_structure

    way = method or ON_RESPONSES
    of_response, of_method, *of_files = _divided(way, options)
    model = load_structure(name, axis=axis)
    channels: dict[str, Any] = {"inputs": model.inputs, "outputs": model.outputs}
    read = read_files(
        files, *of_files, **channels, units=model.units,
        excitations=of_response.get("excitations"),
    )  # fmt: skip
    data: Any = read
    if (way == JOINT) != bool(beside["records"]):
        raise click.UsageError(
            f"--method {JOINT} and --records belong together: the response comes from FILES, "
            "the records stand beside it"
        )
    if way in (ON_RESPONSES, JOINT):
        data = flightid.estimate_response(read, **channels, **of_response, loop=loop)
    if way == JOINT:
        span = {} if beside["span_s"] is None else {"span_s": beside["span_s"]}
        more = read_files(beside["records"], of_files[0], span, **channels, units=model.units)
        data = [data, *more]
    return flightid.identify(model, data, method=way, loop=loop, **of_method), data


def _methods() -> dict[str, type[Options]]:
    """Options of the methods for models with equations."""
    from flightid.identification.methods import METHODS
    from flightid.models import StateSpaceModel

    return {way.name: way.options for way in METHODS if StateSpaceModel in way.kinds}


def _of_responses() -> type[Options]:
    from flightid.responses.options import ResponseOptions

    return ResponseOptions


def _divided(method: str, options: dict[str, Any]) -> list[dict[str, Any]]:
    """What was given for the estimate of the response, for the fit, and for reading files."""
    from flightid.options import options_of

    methods = _methods()
    if method not in methods:
        raise click.BadParameter(
            f"{method!r} is none of {', '.join(methods)}", param_hint="--method"
        )
    fitted = methods[method]
    if method not in (ON_RESPONSES, JOINT):
        return [{}, *parted(options, {method: fitted, **reading()})]
    given = {name: value for name, value in options.items() if value not in (None, ())}
    of_response, of_fit, *of_files = parted(
        given, {"a response": _of_responses(), method: fitted, **reading()}
    )
    # One word may serve both: the band is that of the response, the rest that of the fit.
    shared = {each.name for each in options_of(fitted)} - {"band_rad_s"}
    of_fit.pop("band_rad_s", None)
    of_response = {name: value for name, value in of_response.items() if name not in shared}
    return [of_response, of_fit, *of_files]


def _with_inspection(result: Fit | Reduction, file: Path) -> Fit | Reduction:
    """The fit, or every fit of a reduction, with the verdict on the log among its evidence."""
    import flightid
    from flightid.evidence import inspection_check

    inspection = flightid.inspect_log(file)

    def examined(fit: Fit) -> Fit:
        check = inspection_check(inspection, (*fit.model.inputs, *fit.model.outputs))
        return replace(fit, evidence=fit.evidence.with_checks([check]))

    if not isinstance(result, flightid.Reduction):
        return examined(result)
    path = tuple(
        step if step.fit is None else replace(step, fit=examined(step.fit)) for step in result.path
    )
    return replace(result, start=examined(result.start), path=path)
