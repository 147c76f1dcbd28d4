"""What a study file may say about frequency responses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from flightid.frozen import dataclass
from flightid.logs.to_record import EXCITATION
from flightid.options import option
from flightid.record.hold import LOOPS, Loop
from flightid.responses.options import ESTIMATORS, ResponseOptions

TEST = "test"
"""Word of the key ``loop`` where nobody declares it."""


@dataclass(frozen=True)
class ResponseSettings(ResponseOptions):
    """How frequency responses are estimated: options of the verb, and which ones are fitted."""

    compare: tuple[str, ...] = option((), choices=ESTIMATORS, doc="Estimators shown beside it.")
    excitations: tuple[str, ...] = option(
        (EXCITATION,), doc="Injected signals, independent of noise, for estimator 'instrument'."
    )
    inputs: tuple[str, ...] = option(
        (), doc="All inputs that moved, on which responses are conditioned."
    )
    n_omega: int = option(60, minimum=5, doc="Log-spaced frequencies in each model's band.")
    minimum_coherence: float = option(
        0.6, above=0.0, maximum=1.0, doc="Points with less coherence are left out of a fit."
    )
    minimum_decades: float | None = option(
        None,
        above=0.0,
        doc="Width of the coherent band that a response needs to be chosen; not told: 0.3; 0.2 "
        "for an input of a structure without equations, which keeps its only inputs all the same.",
    )
    loop: str = option(  # type: ignore[assignment]  # a file has no word for None
        TEST, choices=(TEST, *LOOPS), doc="Whether a loop was closed, where it is known."
    )

    @property
    def declared_loop(self) -> Loop | None:
        """What is declared; None where the test decides."""
        return "open" if self.loop == "open" else "closed" if self.loop == "closed" else None

    @property
    def estimators(self) -> tuple[str, ...]:
        """The one that counts, then those beside it."""
        return tuple(dict.fromkeys((self.estimator, *self.compare)))

    def moved(self, own: Sequence[str]) -> tuple[str, ...]:
        """The model's inputs and those that moved beside them."""
        return tuple(dict.fromkeys((*own, *self.inputs)))

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels that the estimators need beside inputs and outputs."""
        return self.excitations if "instrument" in self.estimators else ()

    @property
    def of_estimates(self) -> ResponseSettings:
        """Only what an estimate reads: other limits of coherence make no other estimate."""
        kept = ("excitations", "n_omega", "window_s", "overlap", "detrend", "covariance", "loop")
        return ResponseSettings(**{name: getattr(self, name) for name in kept})

    def of_verb(self, estimator: str) -> dict[str, Any]:
        """What `flightid.estimate_response` is given for one of the estimators."""
        return {
            "estimator": estimator,
            "excitations": self.excitations if estimator == "instrument" else None,
            "loop": self.declared_loop,
            **{name: getattr(self, name) for name in ("n_omega", "window_s", "overlap", "detrend")},
            "covariance": self.covariance,
        }
