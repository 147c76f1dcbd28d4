"""Models with equations on the command line: methods, their options, fits to the same data."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.log_parts import with_instrument
from flightid.cli.option_fields import parted
from flightid.cli.records import read_files, reading
from flightid.errors import UnknownNameError

if TYPE_CHECKING:
    from flightid.identification import Fit
    from flightid.models import GreyBoxModel, Model
    from flightid.options import Options
    from flightid.record import Record

USUAL, JOINT = "frequency_domain", "joint"


def methods() -> dict[str, type[Options]]:
    """Options of the methods for models with equations, by name."""
    from flightid.identification.methods import METHODS
    from flightid.models import StateSpaceModel

    return {way.name: way.options for way in METHODS if StateSpaceModel in way.kinds}


def _on_responses(method: str) -> bool:
    from flightid.identification.methods import takes_responses

    return takes_responses(method)


def equations() -> dict[str, type[Options]]:
    """Options of responses and of the methods, by what takes them."""
    return {"responses": _of_responses(), **methods()}


def fits_of(
    names: Iterable[str],
    axis: str | None,
    method: str | None,
    files: Sequence[Path],
    options: dict[str, Any],
    *,
    beside: Sequence[Path] = (),
    beside_span_s: tuple[float, float] | None = None,
) -> tuple[dict[str, Fit], Any]:
    """Fits of models with equations by name, and the data that they were fitted to.

    Parameters
    ----------
    names : iterable of str
        Library models or model files, of the same inputs and outputs.
    axis : str, optional
        Of a library model.
    method : str, optional
        Default: to a response.
    files : sequence of Path
    options : dict of str to object
        Values of the command's options, ``loop`` among them.
    beside : sequence of Path
        Records of a joint fit, the part of them in `beside_span_s`.

    Raises
    ------
    click.UsageError
        Models of other channels, or records beside a response where the method takes none.
    """
    from flightid import estimate_response, identify
    from flightid.identification.frequency_domain.longer_windows import second_pass
    from flightid.models import load_structure
    from flightid.responses.options import AUTOMATIC

    way, loop = method or USUAL, options.pop("loop", None)
    columns = {role: options.pop(role, None) or () for role in ("inputs", "outputs")}
    # Records keep what was injected: what a free run in a loop leaves is tested against that.
    beside_inputs = (
        () if way in methods() and _on_responses(way) else options.pop("excitations", ())
    )
    of_response, of_method, *of_files = _divided(way, options)
    loaded = {name: load_structure(name, axis=axis) for name in names}
    _require_same_channels(loaded)
    models, columns["outputs"] = _measured(loaded, columns["outputs"])
    (first, *_) = models.values()
    channels: dict[str, Any] = {"inputs": first.inputs, "outputs": first.outputs}
    named: dict[str, Any] = {
        role: _columns_of(role, channels[role], columns[role]) for role in channels
    }
    if (way == JOINT) != bool(beside):
        raise click.UsageError(
            f"--method {JOINT} and --records belong together: the response comes from FILES, "
            "the records stand beside it"
        )
    injected = beside_inputs or of_response.get("excitations")
    with _said_to_leave_out(channels["outputs"]):
        read = read_files(
            files, *of_files, **named, units=first.units, excitations=injected, take="flown"
        )
    more: list[Record] = []
    if way == JOINT:
        span = {} if beside_span_s is None else {"span_s": beside_span_s}
        more = read_files(beside, of_files[0], span, **named, units=first.units)

    def fitted(data: Any) -> tuple[dict[str, Fit], Any]:  # noqa: ANN401 — records, or a response
        whole = [data, *more] if more else data
        fits = {
            name: identify(model, whole, method=way, loop=loop, **of_method)
            for name, model in models.items()
        }
        return fits, whole

    if not _on_responses(way):
        return fitted(read)
    of_response = with_instrument(of_response, files, read, first.inputs)
    estimate = partial(estimate_response, read, **channels, loop=loop)
    response = estimate(**of_response)
    found = fitted(response)
    if of_response.get("window_s", AUTOMATIC) != AUTOMATIC:
        return found
    return second_pass(
        found,
        [fit.model for fit in found[0].values()],
        response,
        lambda longer: fitted(longer.estimate(estimate, of_response)),
        banded="band_rad_s" in of_response,
    )


def _measured(
    models: Mapping[str, GreyBoxModel], named: Sequence[str]
) -> tuple[Mapping[str, GreyBoxModel], Sequence[str]]:
    """Models that measure some of their outputs where those alone are named, and no column then."""
    from flightid.models import StateSpaceModel

    wide = {name: each for name, each in models.items() if isinstance(each, StateSpaceModel)}
    few = all(set(named) < set(each.outputs) for each in wide.values())
    if not named or len(wide) < len(models) or not few:
        return models, named
    return {name: each.with_outputs(*named) for name, each in wide.items()}, ()


@contextmanager
def _said_to_leave_out(outputs: Sequence[str]) -> Iterator[None]:
    """Tell how an output that files do not hold is left out of the equations."""
    try:
        yield
    except UnknownNameError as error:
        others = [name for name in outputs if name != error.found]
        if error.action or not others or len(others) == len(outputs):
            raise
        raise UnknownNameError(
            error.problem,
            found=error.found,
            needed=error.needed,
            action=f"name its column with --outputs, in the order {', '.join(outputs)}, or leave "
            f"it out: --outputs {','.join(others)}",
        ) from error


def _columns_of(
    role: str, channels: Sequence[str], columns: Sequence[str]
) -> Sequence[str] | dict[str, str]:
    """Channels of equations, with the columns that stand for them where those were named."""
    from flightid.study.proposal.columns import columns_by_channel

    if not columns:
        return channels
    other = columns_by_channel(channels, columns)
    if other is None:
        raise click.UsageError(
            f"the {role} of these equations are {', '.join(channels)}: --{role} names a column for "
            f"each, in their order; found {', '.join(columns)}"
        )
    return {name: other.get(name, name) for name in channels} if other else channels


def _require_same_channels(models: Mapping[str, Model]) -> None:
    found = {(tuple(each.inputs), tuple(each.outputs)) for each in models.values()}
    if len(found) > 1:
        words = "; ".join(
            f"{name}: {', '.join(each.outputs)} from {', '.join(each.inputs)}"
            for name, each in models.items()
        )
        raise click.UsageError(f"these models have other inputs or outputs: {words}")


def _of_responses() -> type[Options]:
    from flightid.responses.options import ResponseOptions

    return ResponseOptions


def _divided(method: str, options: dict[str, Any]) -> list[dict[str, Any]]:
    """What was given for the estimate of the response, for the fit, and for reading files."""
    from flightid.options import options_of

    known = methods()
    if method not in known:
        raise click.BadParameter(f"{method!r} is none of {', '.join(known)}", param_hint="--method")
    fitted = known[method]
    if not _on_responses(method):
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
