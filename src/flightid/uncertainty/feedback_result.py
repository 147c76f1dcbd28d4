"""Whether a loop was closed around a vehicle, and how that is known."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Literal

import numpy as np

from flightid.errors import OptionError
from flightid.frozen import dataclass
from flightid.record.history import Step, is_of_log, spread_channels
from flightid.record.hold import LOOPS
from flightid.surface import spoken

LEVEL = 0.01
"""Share of open loops that are called closed."""
LAGS = 12
"""Past samples of noise that may move an input."""
BEARABLE = 1.0
"""Standard errors by which a loop that no test sees may bend an estimate."""
NEARLY = 0.999
"""Share of what is new in an input from which outputs leave nothing else that moves it."""


@dataclass(frozen=True)
class FeedbackTest:
    """Whether a loop was closed around the vehicle, and how that is known.

    Attributes
    ----------
    loop : {"open", "closed", "unknown"}
    source : {"test", "declared", "log", "repeats", "instrument", "noise model", "no noise", ...}
        How it is known: the test of past noise; the user's word; a log, whose autopilot closes it;
        inputs that repeat exactly, or outputs without noise, which feed nothing back; an estimate
        by way of an excitation or of a model of the noise, which a closed loop does not bias. Or
        why it is not ("same sample", "too
        short", "filtered", "noisy input", "blind"): input and output go together within a sample;
        records too short to tell; samples made of later ones, which look like feedback, or noise of
        an input's sensor, which does too; a loop that bends estimates would not have been seen.
    p_value : float or None
        Chance of so large a share with the loop open, over all inputs; None without a test.
    input : str or None
        Input that past noise explains most.
    share : float or None
        Share of what is new in it that past noise explains, or with source "same sample" the
        outputs up to its own sample.
    lags : int
        Past samples of noise that were asked.
    input_noise : float or None
        With source "noisy input": rms of the noise that would explain it, over that of the input.
    unseen_share, unseen_bias : float or None
        Where no loop is seen: the smallest feedback of one output to `input` that would have been,
        in 95 of 100 tests, as a share of the input's variance (above 1: more than all of it), and
        the bias that it leaves, in standard errors; where that is largest.

    Example
    -------
    >>> FeedbackTest("open", "declared").is_closed
    False
    """

    loop: Literal["open", "closed", "unknown"]
    source: str
    p_value: float | None = None
    input: str | None = None
    share: float | None = None
    lags: int = LAGS
    input_noise: float | None = None
    unseen_share: float | None = None
    unseen_bias: float | None = None

    @property
    def is_closed(self) -> bool:
        """Whether estimates from these inputs straight to outputs are biased."""
        return self.loop == "closed" and not self.is_taken_care_of

    @property
    def is_known(self) -> bool:
        """Whether the loop is told to be open or closed."""
        return self.loop != "unknown"

    @property
    def is_taken_care_of(self) -> bool:
        """Whether the way of estimating keeps a closed loop from bending it."""
        return self.source in ("instrument", "noise model")

    @property
    def is_function_of_outputs(self) -> bool:
        """Whether outputs leave nothing else that moves an input: a model may be a controller."""
        return self.source == "same sample" and (self.share or 0.0) >= NEARLY

    @property
    def may_turn_round(self) -> bool:
        """Whether an answer of outputs to inputs is as well that of a controller to outputs."""
        return self.is_closed or self.is_function_of_outputs

    def __str__(self) -> str:
        """What is known and how, in a sentence."""
        words = {
            "declared": f"loop {self.loop}, as declared",
            "repeats": "loop open: the inputs repeat exactly, so nothing is fed back",
            "same sample": (
                f"whether a loop is closed cannot be told: outputs up to the same sample explain "
                f"{_percent(self.share)} % of what is new in input {self.input}, as a controller "
                "without delay or a vehicle that answers at once would"
            ),
            "instrument": "estimated by way of the excitation, which a closed loop does not bias",
            "noise model": "estimated with a model of the noise, which a closed loop does not bias",
            "no noise": "no loop seen: the outputs hold no noise that could be fed back",
            "filtered": (
                "whether a loop is closed cannot be told: channels were brought to another grid "
                "with samples from before and after it, so that outputs foretell inputs"
            ),
            "noisy input": (
                f"whether a loop is closed cannot be told: past outputs explain "
                f"{_percent(self.share)} % of what is new in input {self.input}, as a loop would, "
                f"or {_percent(self.input_noise)} % of noise (rms) in what measured that input"
            ),
            "blind": (
                f"whether a loop is closed cannot be told: none is seen, but one that makes "
                f"{self._unseen} would not be, and may bend estimates by {self._bias} standard "
                "errors"
            ),
            "too short": "whether a loop is closed cannot be told: the records are too short",
            "log": "loop closed: in an autopilot's log controller and pilot move the inputs after "
            "what the outputs do, whether a test sees it or not",
        }
        if self.source in words:
            return words[self.source]
        seen, chance = "past noise of the outputs explains", spoken(f"(p = {self.p_value:.2g})")
        if self.loop == "closed":
            share = f"{_percent(self.share)} % of what is new in input {self.input}"
            return f"loop closed: {seen} {share} {chance}"
        power = ""
        if self.unseen_bias is not None:
            power = (
                f"; one that makes {self._unseen} would be, and a smaller one bends estimates by "
                f"less than {self._bias} standard errors"
            )
        return f"no loop seen: {seen} no more of the inputs than chance may {chance}{power}"

    @property
    def _bias(self) -> str:
        bias = self.unseen_bias or 0.0
        return "ten or more" if bias >= 10.0 else f"{max(bias, 0.01):.2g}"

    @property
    def _unseen(self) -> str:
        share = self.unseen_share or 0.0
        return f"{'all' if share >= 1.0 else f'{100.0 * share:.2g} %'} of input {self.input}"

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {
            "loop": self.loop,
            "source": self.source,
            "p_value": self.p_value,
            "input": self.input,
            "share": self.share,
            "lags": self.lags,
            "input_noise": self.input_noise,
            "unseen_share": self.unseen_share,
            "unseen_bias": self.unseen_bias,
        }


def _percent(share: float | None) -> str:
    """A share in percent, cut so that only all of it reads 100."""
    return f"{np.floor(1e4 * (share or 0.0)) / 100.0:.4g}"


def unless_spread(
    test: FeedbackTest, histories: Iterable[Iterable[Step]], names: Iterable[str]
) -> FeedbackTest:
    """A test of channels, "filtered" where some were without phase, which looks like feedback."""
    found = test.source == "test" and test.is_closed and spread_channels(histories, names)
    return replace(test, loop="unknown", source="filtered") if found else test


def unless_logged(test: FeedbackTest, histories: Iterable[Iterable[Step]]) -> FeedbackTest:
    """A test that sees no loop, closed where the data are of an autopilot's log.

    Parameters
    ----------
    test : FeedbackTest
    histories : iterable
        Of the records.

    Example
    -------
    >>> unless_logged(FeedbackTest("open", "test", 0.4), [[Step("Log.record")]]).loop
    'closed'
    """
    said = test.source == "declared" or test.loop == "closed"
    return test if said or not is_of_log(histories) else replace(test, loop="closed", source="log")


def unless_blind(test: FeedbackTest) -> FeedbackTest:
    """A test that saw no loop, "blind" where one that it misses bends estimates by their errors.

    Example
    -------
    >>> unless_blind(FeedbackTest("open", "test", 0.4, "u", 0.01, unseen_bias=8.0)).source
    'blind'
    """
    blind = test.loop == "open" and test.source == "test" and (test.unseen_bias or 0.0) > BEARABLE
    return replace(test, loop="unknown", source="blind") if blind else test


def declared_loop(loop: str) -> FeedbackTest:
    """The user's word.

    Raises
    ------
    OptionError
        Another word.
    """
    for word in LOOPS:
        if loop == word:
            return FeedbackTest(word, "declared")
    raise OptionError("loop is not known", found=repr(loop), needed="'open' or 'closed'")
