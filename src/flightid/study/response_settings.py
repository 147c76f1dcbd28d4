"""What a study file may say about frequency responses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from flightid.record.hold import LOOPS, Loop
from flightid.study.reading import TableReader

ESTIMATORS = ("composite", "local_polynomial", "instrument")
EXCITATION = "excitation"


TEST = "test"
"""Word of the key ``loop`` where nobody declares it."""


@dataclass(frozen=True)
class ResponseSettings:
    """How frequency responses are estimated.

    Attributes
    ----------
    estimator : str
        Estimator whose result is fitted.
    compare : tuple of str
        Estimators shown beside it.
    instruments : tuple of str
        Channels that move the inputs from outside the loop, for the instrument estimator.
    inputs : tuple of str
        All inputs that moved: responses are conditioned on those beside the model's own.
    n_omega : int
        Frequencies in each model's band, spaced evenly in the logarithm.
    window_s : tuple of float
        Window lengths, s; empty: chosen by the estimator.
    minimum_coherence : float
        Frequencies below it take no part in a fit.
    minimum_decades : float
        Width of the coherent band that a response needs where coherence chooses responses.
    loop : str
        "open" or "closed" where it is known, else "test".
    """

    estimator: str = "composite"
    compare: tuple[str, ...] = ()
    instruments: tuple[str, ...] = (EXCITATION,)
    inputs: tuple[str, ...] = ()
    n_omega: int = 60
    window_s: tuple[float, ...] = ()
    minimum_coherence: float = 0.6
    minimum_decades: float = 0.3
    loop: str = TEST

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
        return self.instruments if "instrument" in self.estimators else ()


def read_response(reader: TableReader, usual: ResponseSettings | None = None) -> ResponseSettings:
    """Check a table ``[response]``; what it does not say is as `usual`.

    Raises
    ------
    StudyError
        A key is unknown or a value does not fit.
    """
    usual = usual or ResponseSettings()
    compare = reader.names("compare", usual.compare)
    for word in compare:
        if word not in ESTIMATORS:
            raise reader.error("compare", "does not fit", found=word, needed=", ".join(ESTIMATORS))
    made = ResponseSettings(
        reader.choice("estimator", ESTIMATORS, usual.estimator),
        compare,
        reader.names("instruments", usual.instruments),
        reader.names("inputs", usual.inputs),
        reader.integer("n_omega", usual.n_omega, minimum=5),
        reader.numbers("window_s", usual.window_s),
        reader.positive("minimum_coherence", usual.minimum_coherence),
        reader.positive("minimum_decades", usual.minimum_decades),
        reader.choice("loop", (TEST, *LOOPS), usual.loop),
    )
    reader.finish()
    return made
