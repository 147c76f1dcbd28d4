"""``flightid response-arithmetic``: products, ratios, sums and loops of saved responses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from flightid.cli.lists import ListsCommand
from flightid.cli.output import all_option, json_option, level_option
from flightid.cli.pages import html_option
from flightid.cli.response import show_response, write_option
from flightid.cli.sources import load_source

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from flightid.responses import FrequencyResponse
    from flightid.responses.arithmetic import Known

OF_LOOPS, OF_TWO = ("close-loop", "open-loop"), ("multiply", "divide", "add")
ALONE = "loop-of-sensitivity"
MODELS = (".toml", ".json")


@click.command(
    cls=ListsCommand,
    short_help="Multiply, divide, add saved responses; close and open loops.",
)
@click.argument("operation", type=click.Choice([*OF_TWO, *OF_LOOPS, ALONE]))
@click.argument("response", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.argument("other", required=False)
@click.option(
    "--pair",
    "pairs",
    multiple=True,
    metavar="OUTPUT/INPUT",
    help="Of RESPONSE; given again: of OTHER. Default: all that a file holds.",
)
@click.option("--actuator", metavar="KNOWN", help="Of a loop, ahead of the vehicle in it.")
@write_option
@level_option
@html_option
@all_option
@json_option
def command(
    operation: str,
    response: Path,
    other: str | None,
    pairs: tuple[str, ...],
    actuator: str | None,
    target: Path | None,
    level: float | None,
    html: Path | None,
    as_json: bool,
) -> None:
    """Compute with responses that `flightid response --write` wrote, and carry their errors on.

    OTHER is a response, or what is known without error: a number, coefficients in s with the
    highest power first ("1 / 0.05 1" lags by 0.05 s), or a model of one input and one output.
    What is known has no unit: channels keep theirs.

    \b
    multiply, divide, add   RESPONSE and OTHER; two responses need a common channel
    close-loop              A H / (1 + A H K): OTHER is the feedback K, A the --actuator
    open-loop               H / (A (1 - H K)): the vehicle behind actuator A and rate gyro K
    loop-of-sensitivity     1/S - 1, without OTHER
    """  # noqa: D301 — click reads the mark
    from flightid.record.history import Step
    from flightid.responses import arithmetic
    from flightid.version import VERSION

    if (other is None) != (operation == ALONE):
        raise click.UsageError(f"{operation} takes {'no' if other else 'an'} OTHER")
    if actuator is not None and operation not in OF_LOOPS:
        raise click.UsageError(f"--actuator belongs to {' and '.join(OF_LOOPS)}")
    if len(pairs) > 1 + (operation in OF_TWO):
        raise click.UsageError("--pair names one pair of each response")
    whole = operation in OF_TWO and not _is_response(other)
    first = _read(response, *pairs[:1], whole=whole)
    ahead = _known(actuator) if actuator else 1.0
    if other is None:
        made = arithmetic.loop_of_sensitivity(first)
    elif operation == "close-loop":
        made = arithmetic.close_loop(arithmetic.apply_known(first, ahead), _known(other))
    elif operation == "open-loop":
        made = arithmetic.peel_loop(first, ahead, _known(other))
    elif _is_response(other):
        made = getattr(arithmetic, operation)(first, _read(Path(other), *pairs[1:]))
    elif operation == "add" or len(pairs) > 1:
        raise click.UsageError(f"OTHER {other!r} is no file of a response, which this needs")
    else:
        made = arithmetic.apply_known(first, _known(other), invert=operation == "divide")
    told = {"other": other, "actuator": actuator, "pairs": ", ".join(pairs)}
    step = Step(f"response_arithmetic.{operation}", {"response": response.name, **told}, VERSION)
    made = replace(made, history=(*made.history, step))
    show_response(made, target, html, as_json=as_json, level=level)


def _read(path: Path, pair: str = "", *, whole: bool = False) -> FrequencyResponse:
    from flightid.responses.store import read_response

    found = read_response(path)
    if not pair:
        held = [f"{output}/{name}" for output in found.outputs for name in found.inputs]
        if len(held) > 1 and not whole:
            raise click.UsageError(f"{path} holds {', '.join(held)}: name one of them by --pair")
        return found
    output, slash, name = pair.partition("/")
    if not slash:
        raise click.UsageError(f"--pair {pair!r} must be OUTPUT/INPUT")
    return found.select(outputs=[output], inputs=[name])


def _is_response(text: str | None) -> bool:
    return text is not None and Path(text).is_file() and Path(text).suffix not in MODELS


def _known(text: str) -> Known:
    """What a user knows: a number, coefficients of s, or a model."""
    import numpy as np

    above, _, below = text.partition("/")
    try:
        powers = [[float(word) for word in part.split()] for part in (above, below or "1")]
    except ValueError:
        return _of_model(text)

    def known(s: NDArray[np.complex128]) -> NDArray[np.complex128]:
        with np.errstate(
            divide="ignore", invalid="ignore"
        ):  # its reader refuses what is not finite
            return np.asarray(np.polyval(powers[0], s) / np.polyval(powers[1], s))

    return known


def _of_model(name: str) -> Known:
    from flightid.control.margins.loop_source import ResponseSource, known_values
    from flightid.models import linear_system

    model = load_source(name)
    source = model if isinstance(model, ResponseSource) else linear_system(model)
    return lambda s: known_values(source, s.imag)
