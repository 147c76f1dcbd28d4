"""How inputs move between their samples and whether they repeat: what a record knows of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, cast

import numpy as np

from flightid.errors import OptionError
from flightid.frozen import dataclass

InputHold = Literal["zero", "first", "band_limited"]
Loop = Literal["open", "closed"]
LOOPS: tuple[Loop, ...] = ("open", "closed")
HOLDS: tuple[InputHold, ...] = ("zero", "first", "band_limited")
SAME_SAMPLE_TIME = 1e-6
"""Largest relative difference of sample times that still counts as the same."""


@dataclass(frozen=True)
class InputShape:
    """What is known of the inputs of a record beyond their samples.

    Attributes
    ----------
    hold : {"zero", "first", "band_limited"} or None
        Between samples an input stands still (steps at the samples), moves on a straight line, or
        is the smooth signal without power above half the sampling rate. None: not known.
    period_s : float or None
        Time after which the inputs repeat exactly, s. None: not known, or they do not.
    loop : {"open", "closed"} or None
        Whether anything (pilot, autopilot) moved the inputs after what the outputs did. None: not
        known; then it is tested.

    Raises
    ------
    OptionError
        Another word, or a period that is not positive.

    Example
    -------
    >>> InputShape("zero", 2.55)
    InputShape(hold='zero', period_s=2.55, loop=None)
    """

    hold: InputHold | None = None
    period_s: float | None = None
    loop: Loop | None = None

    def __post_init__(self) -> None:
        if self.hold is not None:
            require_hold(self.hold, HOLDS)
        if self.loop is not None and self.loop not in LOOPS:
            raise OptionError("loop is not known", found=repr(self.loop), needed="open or closed")
        if self.period_s is not None and not (np.isfinite(self.period_s) and self.period_s > 0.0):
            raise OptionError(
                "the period has no meaning", found=self.period_s, needed="seconds, above 0"
            )

    def __str__(self) -> str:
        """Both in words."""
        between = BETWEEN[self.hold] if self.hold else "not known"
        repeat = "" if self.period_s is None else f"; they repeat every {self.period_s:.6g} s"
        loop = "" if self.loop is None else f"; loop {self.loop}"
        return f"inputs between samples: {between}{repeat}{loop}"

    def with_known(self, more: InputShape) -> InputShape:
        """The same with what is known besides; the new word counts."""
        return InputShape(
            more.hold or self.hold, more.period_s or self.period_s, more.loop or self.loop
        )

    def on_another_base(self, before_s: float, after_s: float) -> InputShape:
        """What is still known after samples were taken at another sample time.

        Steps and straight lines end at the samples they were made for; only the smooth signal is
        the same on any base that is fine enough.
        """
        if abs(after_s / before_s - 1.0) <= SAME_SAMPLE_TIME or self.hold == "band_limited":
            return self
        return self.without_hold()

    def without_hold(self) -> InputShape:
        """What is left where an operation breaks the hold."""
        return replace(self, hold=None)

    def to_dict(self) -> dict[str, str | float | None]:
        """Plain values."""
        return {"hold": self.hold, "period_s": self.period_s, "loop": self.loop}


BETWEEN: dict[InputHold, str] = {
    "zero": "steps",
    "first": "straight lines",
    "band_limited": "smooth",
}


def common_loop(shapes: Sequence[InputShape]) -> Loop | None:
    """The loop that is known of several records together: closed where one of them is."""
    loops = {shape.loop for shape in shapes}
    if "closed" in loops:
        return "closed"
    return "open" if loops == {"open"} else None


def common_hold(shapes: Sequence[InputShape]) -> InputHold | None:
    """The hold that all of several records know; None where one does not or two differ."""
    holds = {shape.hold for shape in shapes}
    return holds.pop() if len(holds) == 1 else None


def require_hold(hold: str, known: tuple[str, ...]) -> InputHold:
    """The hold, refused where a verb does not know it.

    Raises
    ------
    OptionError
        Another word.
    """
    if hold not in known:
        raise OptionError("hold is not known", found=repr(hold), needed=" or ".join(known))
    return cast("InputHold", hold)
