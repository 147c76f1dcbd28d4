"""What a study file may say about the fit of a model and its verification."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from flightid.errors import StudyError
from flightid.identification.methods import METHODS, RECORDS
from flightid.identification.prediction.request import FREE_RUN
from flightid.models import StateSpaceModel
from flightid.options import options_of, read_options
from flightid.study.reading import TableReader

FREQUENCY_DOMAIN = "frequency_domain"
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
    horizons : tuple of int or "free_run"
        Samples ahead; empty: a free run, and of models without equations one sample as well.
    residual_tests : bool or None
        Whether residuals of fits to records are tested; None: of models without equations.
    spectra : bool or None
        Whether the spectrum of a free run stands beside the measured one; None: the same.
    without_equations : bool
        What of a model is usual where nothing is said.
    """

    initial_state: str | None = None
    settle_s: float | None = None
    state_bias: bool | None = None
    output_bias: bool | None = None
    horizons: tuple[int | str, ...] = ()
    residual_tests: bool | None = None
    spectra: bool | None = None
    against_responses: bool = False
    without_equations: bool = False

    @property
    def options(self) -> dict[str, Any]:
        """What `flightid.verify` is given."""
        names = ("initial_state", "settle_s", "state_bias", "output_bias")
        given = {name: getattr(self, name) for name in names}
        return {name: value for name, value in given.items() if value is not None}

    @property
    def ahead(self) -> tuple[int | str, ...]:
        """Horizons of the predictions, the one that counts first."""
        return self.horizons or ((FREE_RUN, 1) if self.without_equations else (FREE_RUN,))

    @property
    def tests_residuals(self) -> bool:
        """Whether residuals are tested."""
        return self.without_equations if self.residual_tests is None else self.residual_tests

    @property
    def compares_spectra(self) -> bool:
        """Whether spectra stand side by side."""
        return self.without_equations if self.spectra is None else self.spectra


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
    known = [each.name for each in options_of(kind)]
    given = {key: value for key, value in reader.rest().items() if key != "method"}
    kept = {key: value for key, value in usual.options.items() if key in known}
    where = f"study file, {reader.where}"
    read = read_options(kind, {**kept, **given}, where, error=StudyError)
    return FitSettings(method, {name: getattr(read, name) for name in {**kept, **given}})


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
        _horizons(reader, usual.horizons),
        given(reader.flag, "residual_tests", usual.residual_tests),
        given(reader.flag, "spectra", usual.spectra),
        reader.flag("against_responses", usual.against_responses),
    )
    reader.finish()
    return made


def _horizons(reader: TableReader, usual: tuple[int | str, ...]) -> tuple[int | str, ...]:
    def fits(value: object) -> bool:
        counted = isinstance(value, int) and not isinstance(value, bool) and value > 0
        return counted or value == FREE_RUN

    return reader.several("horizons", fits, "'free_run' or a number of samples", usual)
