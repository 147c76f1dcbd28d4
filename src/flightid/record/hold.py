"""How inputs move between their samples and whether they repeat: what a record knows of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, cast

import numpy as np

from flightid.errors import OptionError

InputHold = Literal["zero", "first", "band_limited"]
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

    Raises
    ------
    OptionError
        Another word, or a period that is not positive.

    Example
    -------
    >>> InputShape("zero", 2.55)
    InputShape(hold='zero', period_s=2.55)
    """

    hold: InputHold | None = None
    period_s: float | None = None

    def __post_init__(self) -> None:
        if self.hold is not None:
            require_hold(self.hold, HOLDS)
        if self.period_s is not None and not (np.isfinite(self.period_s) and self.period_s > 0.0):
            raise OptionError(
                "the period has no meaning", found=self.period_s, needed="seconds, above 0"
            )

    def __str__(self) -> str:
        """Both in words."""
        between = BETWEEN[self.hold] if self.hold else "not known"
        repeat = "" if self.period_s is None else f"; they repeat every {self.period_s:.6g} s"
        return f"inputs between samples: {between}{repeat}"

    def on_another_base(self, before_s: float, after_s: float) -> InputShape:
        """What is still known after samples were taken at another sample time.

        Steps and straight lines end at the samples they were made for; only the smooth signal is
        the same on any base that is fine enough.
        """
        if abs(after_s / before_s - 1.0) <= SAME_SAMPLE_TIME or self.hold == "band_limited":
            return self
        return InputShape(None, self.period_s)

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {"hold": self.hold, "period_s": self.period_s}


BETWEEN: dict[InputHold, str] = {
    "zero": "steps",
    "first": "straight lines",
    "band_limited": "smooth",
}


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
