"""What a study file may say about the fit of a model and its verification."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields
from typing import Any

from flightid.errors import OptionError
from flightid.identification.methods import METHODS, RECORDS
from flightid.models import StateSpaceModel
from flightid.study.reading import TableReader, unknown_key

FREQUENCY_DOMAIN = "frequency_domain"
COUNTS = ("starts", "maximum_iterations", "n_omega")
"""Options that count something: at least one."""
METHOD_NAMES = tuple(way.name for way in METHODS if StateSpaceModel in way.kinds)


@dataclass(frozen=True)
class FitSettings:
    """How models with equations are fitted.

    Attributes
    ----------
    method : str
        Method of `flightid.identify`.
    options : mapping
        Its options, as `flightid.identify` takes them.
    """

    method: str = FREQUENCY_DOMAIN
    options: Mapping[str, Any] = field(default_factory=dict)

    @property
    def on_responses(self) -> bool:
        """Whether the method takes frequency responses, alone or with records."""
        return all(way.data != RECORDS for way in METHODS if way.name == self.method)


@dataclass(frozen=True)
class VerifySettings:
    """How models are verified; see `flightid.verify`.

    Attributes
    ----------
    initial_state : str or None
        None: as the kind of model starts.
    settle_s : float or None
    state_bias, output_bias : bool or None
    against_responses : bool
        Whether models are also judged against the measured responses.
    residual_tests : bool
        Whether residuals of fits to records are tested.
    """

    initial_state: str | None = None
    settle_s: float | None = None
    state_bias: bool | None = None
    output_bias: bool | None = None
    residual_tests: bool = False
    against_responses: bool = False

    @property
    def options(self) -> dict[str, Any]:
        """What `flightid.verify` is given."""
        names = ("initial_state", "settle_s", "state_bias", "output_bias")
        given = {name: getattr(self, name) for name in names}
        return {name: value for name, value in given.items() if value is not None}


def read_fit(reader: TableReader, usual: FitSettings | None = None) -> FitSettings:
    """Check a table ``[fit]``; what it does not say is as `usual`.

    Raises
    ------
    StudyError
        A key that the method does not have, or a value outside its range.
    """
    usual = usual or FitSettings()
    method = reader.choice("method", METHOD_NAMES, usual.method)
    kind = next(way.options for way in METHODS if way.name == method)
    known = [each.name for each in fields(kind)]
    given = {key: _plain(value) for key, value in reader.rest().items() if key != "method"}
    for key in given:
        if key not in known:
            raise unknown_key(reader.where, key, ["method", *known])
    kept = (
        dict(usual.options)
        if method == usual.method
        else {key: value for key, value in usual.options.items() if key in known}
    )
    options = {**kept, **given}
    _require_types(reader, kind, given)
    try:
        kind(**options)
    except OptionError as error:
        raise reader.error(
            ", ".join(given) or "an option", "does not fit", found=str(error), needed="see docs"
        ) from error
    return FitSettings(method, options)


def _plain(value: object) -> object:
    return tuple(value) if isinstance(value, list) else value


def _require_types(reader: TableReader, kind: type[Any], given: Mapping[str, Any]) -> None:
    """A number, flag or word where the option's usual value is one."""
    for each in fields(kind):
        if each.name not in given or each.default is MISSING or each.default is None:
            continue
        value, usual = given[each.name], each.default
        simple = {bool: (bool,), int: (int,), float: (int, float)}
        wanted = simple.get(type(usual))
        wrong = wanted is not None and (
            not isinstance(value, wanted) or (isinstance(value, bool) and type(usual) is not bool)
        )
        wrong = wrong or (each.name in COUNTS and value < 1)
        # Freedom and the initial state take names or a table beside their usual word or flag.
        if wrong and not (isinstance(usual, bool) and isinstance(value, tuple | str)):
            raise reader.error(
                each.name, "does not fit", found=value, needed=f"a value like {usual!r}"
            )


def read_verify(reader: TableReader, usual: VerifySettings | None = None) -> VerifySettings:
    """Check a table ``[verify]``; what it does not say is as `usual`.

    Raises
    ------
    StudyError
        A key is unknown or a value does not fit.
    """
    usual = usual or VerifySettings()

    def given(read: Any, key: str, otherwise: Any) -> Any:  # noqa: ANN401
        value = reader.maybe(read, key)
        return otherwise if value is None else value

    starts = ("trim", "zero", "measured", "estimate")
    made = VerifySettings(
        given(lambda key: reader.choice(key, starts), "initial_state", usual.initial_state),
        given(reader.positive, "settle_s", usual.settle_s),
        given(reader.flag, "state_bias", usual.state_bias),
        given(reader.flag, "output_bias", usual.output_bias),
        reader.flag("residual_tests", usual.residual_tests),
        reader.flag("against_responses", usual.against_responses),
    )
    reader.finish()
    return made
