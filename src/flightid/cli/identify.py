"""``flightid identify``: a model from a log or a record, with its intervals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.option_fields import OptionsCommand, given_options
from flightid.cli.output import emit, json_option, leave_by_verdict, note

if TYPE_CHECKING:
    from flightid.identification import Fit, Reduction
    from flightid.models import GreyBoxModel
    from flightid.options import Options
    from flightid.record import Record
    from flightid.responses import FrequencyResponse

ON_RESPONSES = "frequency_domain"


@click.command(cls=OptionsCommand, fields_of=lambda: {"responses": _of_responses(), **_methods()})
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--model", "model_name", required=True, help="Library name or .toml file.")
@click.option("--axis", type=click.Choice(["roll", "pitch", "yaw"]), help="Of a library model.")
@click.option("--span", nargs=2, type=float, help="First and last instant in a log, s.")
@click.option("--run", "sid_run", type=click.IntRange(0), help="Number of the sweep in a log.")
@click.option(
    "--band",
    "--band-rad-s",
    "band_rad_s",
    nargs=2,
    type=float,
    help="Lowest and highest frequency, rad/s, of a response or of Fourier methods.",
)
@click.option(
    "--method",
    default=ON_RESPONSES,
    show_default=True,
    help="How the model is fitted: frequency_domain to an estimated response; output_error, "
    "filter_error and others straight to the records.",
)
@click.option(
    "--reduce", "reduced", is_flag=True, help="Drop the parameters that the data do not determine."
)
@click.option(
    "--write",
    "written",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Model file (.toml) to write: estimates with covariance and evidence.",
)
@json_option
def command(
    file: Path,
    model_name: str,
    axis: str | None,
    span: tuple[float, float] | None,
    sid_run: int | None,
    band_rad_s: tuple[float, float] | None,
    method: str,
    reduced: bool,
    written: Path | None,
    as_json: bool,
    **options: Any,  # noqa: ANN401 — read from the fields of the method's options
) -> None:
    """Identify a model from FILE, a log or a file of records.

    The exit code is 1 where a verdict is red.
    """
    import flightid
    from flightid.logs import is_log
    from flightid.models import load_structure
    from flightid.progress import progress

    of_response, of_method = _divided(method, options, band_rad_s)
    model = load_structure(model_name, axis=axis)
    with progress(3, "Identifying") as advance:
        data: FrequencyResponse | list[Record]
        data = records = _records(file, model, span, sid_run)
        advance()
        if method == ON_RESPONSES:
            data = flightid.estimate_response(
                records, inputs=model.inputs, outputs=model.outputs, **of_response
            )
        advance()
        fit = flightid.identify(model, data, method=method, **of_method)
        result = flightid.reduce(fit, data) if reduced else fit
        if is_log(file):
            result = _with_inspection(result, file)
        advance()
    note(repr(result))
    if isinstance(result, flightid.Reduction) and not as_json:
        emit(result.fit, as_json=False)
    emit(result, as_json=as_json)
    found = result.fit if isinstance(result, flightid.Reduction) else result
    if written is not None:
        note(f"Wrote {flightid.write_model(found, written)}")
    leave_by_verdict((*result.findings, *found.evidence.findings))


def _methods() -> dict[str, type[Options]]:
    """Options of the methods for models with equations, on a response or on records."""
    from flightid.identification.methods import BOTH, METHODS
    from flightid.models import StateSpaceModel

    return {
        way.name: way.options
        for way in METHODS
        if StateSpaceModel in way.kinds and way.data != BOTH
    }


def _of_responses() -> type[Options]:
    from flightid.responses.options import ResponseOptions

    return ResponseOptions


def _divided(
    method: str, options: dict[str, Any], band_rad_s: tuple[float, float] | None
) -> tuple[dict[str, Any], dict[str, Any]]:
    """What was given for the estimate of the response, and for the fit."""
    from flightid.options import options_of

    methods = _methods()
    if method not in methods:
        raise click.BadParameter(
            f"{method!r} is none of {', '.join(methods)}", param_hint="--method"
        )
    fitted = methods[method]
    band = {} if band_rad_s is None else {"band_rad_s": band_rad_s}
    if method != ON_RESPONSES:
        return {}, given_options(fitted, {**options, **band}, method)
    # One word may serve both: the number of frequencies is that of the fit.
    of_fit = {each.name for each in options_of(fitted)}
    estimated = {name: value for name, value in options.items() if name not in of_fit}
    first = {each.name for each in options_of(_of_responses())} - of_fit
    rest = {name: value for name, value in options.items() if name not in first}
    of_response = given_options(
        _of_responses(), {k: v for k, v in estimated.items() if k in first}, "a response"
    )
    return {**of_response, **band}, given_options(fitted, rest, method)


def _with_inspection(result: Fit | Reduction, file: Path) -> Fit | Reduction:
    """The fit, or every fit of a reduction, with the verdict on the log among its evidence."""
    import flightid
    from flightid.evidence import inspection_check

    check = inspection_check(flightid.inspect_log(file))

    def examined(fit: Fit) -> Fit:
        return replace(fit, evidence=fit.evidence.with_checks([check]))

    if not isinstance(result, flightid.Reduction):
        return examined(result)
    path = tuple(
        step if step.fit is None else replace(step, fit=examined(step.fit)) for step in result.path
    )
    return replace(result, start=examined(result.start), path=path)


def _records(
    file: Path,
    model: GreyBoxModel,
    span: tuple[float, float] | None,
    sid_run: int | None,
) -> list[Record]:
    import flightid
    from flightid.logs import is_log

    names = [*model.inputs, *model.outputs]
    if is_log(file):
        return [flightid.read_log(file).record(names=names, span_s=span, sid_run=sid_run)]
    if span is not None or sid_run is not None:
        raise click.UsageError("--span and --run belong to logs")
    return flightid.read_records(file, inputs=model.inputs, outputs=model.outputs)
