"""``flightid identify``: a model from a log or a record, with its intervals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from flightid.cli.output import emit, json_option, leave_by_verdict, note

if TYPE_CHECKING:
    from flightid.identification import Fit, Reduction
    from flightid.models import GreyBoxModel
    from flightid.record import Record
    from flightid.responses import FrequencyResponse

LOGS = {".bin", ".ulg", ".log"}


@click.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--model", "model_name", required=True, help="Library name or .toml file.")
@click.option("--axis", type=click.Choice(["roll", "pitch", "yaw"]), help="Of a library model.")
@click.option("--span", nargs=2, type=float, help="First and last instant in a log, s.")
@click.option("--run", "sid_run", type=click.IntRange(0), help="Number of the sweep in a log.")
@click.option("--band", nargs=2, type=float, help="Lowest and highest frequency, rad/s.")
@click.option(
    "--method",
    type=click.Choice(["composite", "instrument", "local_polynomial", "output_error"]),
    default="composite",
    show_default=True,
    help="How the response is estimated; with a loop closed: instrument. output_error: no "
    "response, the model is fitted to the records themselves.",
)
@click.option("--starts", type=click.IntRange(1), default=1, show_default=True)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option(
    "--reduce", "reduced", is_flag=True, help="Drop the parameters that the data do not determine."
)
@json_option
def command(
    file: Path,
    model_name: str,
    axis: str | None,
    span: tuple[float, float] | None,
    sid_run: int | None,
    band: tuple[float, float] | None,
    method: str,
    starts: int,
    seed: int,
    reduced: bool,
    as_json: bool,
) -> None:
    """Identify a model from FILE, a log or a file of records.

    The exit code is 1 where a verdict is red.
    """
    import flightid
    from flightid.models import load_structure
    from flightid.progress import progress

    model = load_structure(model_name, axis=axis)
    with progress(3, "Identifying") as advance:
        data: FrequencyResponse | list[Record]
        data = records = _records(file, model, span, sid_run)
        advance()
        if method == "output_error":
            if band is not None:
                raise click.UsageError("--band belongs to responses")
        else:
            data = flightid.estimate_response(
                records,
                inputs=model.inputs,
                outputs=model.outputs,
                band_rad_s=band,
                estimator=method,
            )
        advance()
        fit = flightid.identify(model, data, starts=starts, seed=seed)
        result = flightid.reduce(fit, data) if reduced else fit
        if file.suffix.lower() in LOGS:
            result = _with_inspection(result, file)
        advance()
    note(repr(result))
    if isinstance(result, flightid.Reduction) and not as_json:
        emit(result.fit, as_json=False)
    emit(result, as_json=as_json)
    found = result.fit if isinstance(result, flightid.Reduction) else result
    leave_by_verdict((*result.findings, *found.evidence.findings))


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

    names = [*model.inputs, *model.outputs]
    if file.suffix.lower() in LOGS:
        return [flightid.read_log(file).record(names=names, span_s=span, sid_run=sid_run)]
    if span is not None or sid_run is not None:
        raise click.UsageError("--span and --run belong to logs")
    return flightid.read_records(file, inputs=model.inputs, outputs=model.outputs)
