"""What a study file may say about the fit of a model and its verification."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Any, cast

from flightid.errors import StudyError
from flightid.frozen import dataclass
from flightid.identification.methods import METHODS, takes_responses
from flightid.identification.prediction.request import FREE_RUN
from flightid.models import StateSpaceModel
from flightid.option_forms import WHOLE, Form
from flightid.options import Options, option, options_of, read_options
from flightid.study.reading import TableReader, read_own
from flightid.validation.verification.options import VerifyOptions

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
        return takes_responses(self.method)

    def asked(self, usual: Mapping[str, Any]) -> dict[str, Any]:
        """What `flightid.identify` is given: `usual` where the method has such an option."""
        known = [each.name for each in options_of(_options_by(self.method))]
        kept = {name: value for name, value in usual.items() if name in known}
        return {"method": self.method, **kept, **self.options}


def _options_by(method: str) -> type[Options]:
    return next(way.options for way in METHODS if way.name == method)


def _are_horizons(value: object) -> bool:
    listed = value if isinstance(value, list | tuple) else [value]
    fits = [each == FREE_RUN or (WHOLE.fits(each) and cast(int, each) > 0) for each in listed]
    return all(fits) and len(set(listed)) == len(listed)


HORIZONS = Form(
    "'free_run', a number of samples from 1 on, or a list of them",
    _are_horizons,
    lambda value: tuple(value) if isinstance(value, list | tuple) else (value,),
)


@dataclass(frozen=True)
class VerifySettings(VerifyOptions):
    """How models are verified: options of the verb, and what is looked at beside it."""

    horizons: tuple[int | str, ...] = option(
        (), forms=(HORIZONS,), doc="Horizons of the predictions, the one that counts first."
    )
    residual_tests: bool | None = option(
        None, doc="Test residuals of fits to records; default: of models without equations."
    )
    spectra: bool | None = option(
        None, doc="Show the spectrum of a free run beside the measured one; default: the same."
    )
    against_responses: bool = option(
        False, doc="Judge models against the measured responses as well."
    )
    without_equations: bool = False

    @property
    def options(self) -> dict[str, Any]:
        """What `flightid.verify` is given beside a horizon."""
        names = ("initial_state", "settle_s", "state_bias", "output_bias", "hold")
        return {name: value for name, value in self.given.items() if name in names}

    @property
    def ahead(self) -> tuple[int | str, ...]:
        """Horizons of the predictions, the one that counts first."""
        usual = (FREE_RUN, 1) if self.without_equations else (self.horizon,)
        return self.horizons or usual

    @property
    def tests_residuals(self) -> bool:
        """Whether residuals are tested."""
        return self.without_equations if self.residual_tests is None else self.residual_tests

    @property
    def compares_spectra(self) -> bool:
        """Whether spectra stand side by side."""
        return self.without_equations if self.spectra is None else self.spectra


@dataclass(frozen=True)
class FitMethod(Options):
    """What ``[fit]`` says beside the options of the method."""

    method: str = option(
        FREQUENCY_DOMAIN, choices=METHOD_NAMES, doc="Of identify; its options are keys beside it."
    )


def read_fit(reader: TableReader, usual: FitSettings | None = None) -> FitSettings:
    """Check a table ``[fit]``; what it does not say is as `usual`.

    Raises
    ------
    StudyError
        A key that the method does not have, or a value outside its range.
    """
    usual = usual or FitSettings()
    method = read_own(FitMethod, reader).method if "method" in reader else usual.method
    kind = _options_by(method)
    known = [each.name for each in options_of(kind)]
    kept = {key: value for key, value in usual.options.items() if key in known}
    given = reader.options(kind)
    reader.finish()
    read = read_options(kind, {**kept, **given}, reader.told, error=StudyError)
    return FitSettings(method, {name: getattr(read, name) for name in {**kept, **given}})
