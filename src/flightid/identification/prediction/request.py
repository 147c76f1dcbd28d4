"""What a prediction is asked for, after its checks."""

from __future__ import annotations

from flightid.errors import OptionError
from flightid.frozen import dataclass
from flightid.identification.records.options import InitialState
from flightid.options import Options, option
from flightid.record.hold import HOLDS, InputHold

FREE_RUN = "free_run"
STARTS = ("trim", "zero", "measured", "estimate")
SHARE = 10
"""A tenth of a record tells the state of a sampled model at its beginning."""
LEAST_PER_STATE = 3
"""Samples for each number of the initial state: fewer would follow the noise."""


@dataclass(frozen=True)
class PredictionOptions(Options):
    """What every prediction may be told."""

    horizon: int | str = option(
        FREE_RUN, unit="samples", minimum=1, choices=(FREE_RUN,), doc="How far ahead."
    )
    initial_state: InitialState | None = option(
        None,
        choices=STARTS,
        doc="Where a state begins; default: as told to the fit or declared, else solved for.",
    )
    settle_s: float | None = option(
        None, unit="s", minimum=0.0, doc="First stretch that tells a start and counts no score."
    )


@dataclass(frozen=True)
class Request(PredictionOptions):
    """One way to predict.

    Attributes
    ----------
    horizon : int or "free_run"
        Samples ahead.
    initial_state : str, mapping or None
        ``"trim"``, ``"zero"``, ``"measured"``, ``"estimate"``, or numbers and ``"estimate"`` by
        state; None leaves it to the kind of model.
    settle_s : float or None
        First stretch, s: what is solved for is solved on it alone, and no score counts it. None
        leaves it to the kind of model.
    state_bias, output_bias : bool
        Constants on the state derivatives and on the outputs are solved for.
    hold : {"zero", "first", "band_limited"}
        What the inputs of a continuous model do between samples.

    Example
    -------
    >>> Request(horizon=1).words
    '1 sample ahead'
    """

    state_bias: bool = option(False, doc="Constants on the state derivatives are solved for.")
    output_bias: bool = option(False, doc="Constants on the outputs are solved for.")
    hold: InputHold = option("first", choices=HOLDS, doc="What inputs do between samples.")

    @property
    def words(self) -> str:
        """The horizon in words."""
        if self.horizon == FREE_RUN:
            return "free run"
        return f"{self.horizon} sample{'' if self.horizon == 1 else 's'} ahead"

    def settle_samples(self, n_samples: int, sample_time_s: float) -> int | None:
        """Samples of the first stretch; None where nobody gave it.

        Raises
        ------
        OptionError
            Nothing of the record would be left to score.
        """
        if self.settle_s is None:
            return None
        count = round(self.settle_s / sample_time_s)
        if count >= n_samples:
            raise OptionError(
                "the stretch that settles the start leaves nothing of the record",
                found=f"{self.settle_s:g} s of {n_samples * sample_time_s:g} s",
                needed="a shorter settle_s, or a longer record",
            )
        return count


def usual_stretch(n_samples: int, n_states: int) -> int:
    """First samples on which the start of a sampled model is solved where nobody says how many.

    Example
    -------
    >>> usual_stretch(1000, 4), usual_stretch(50, 4)
    (100, 12)
    """
    return min(max(LEAST_PER_STATE * n_states, n_samples // SHARE), n_samples // 2)
