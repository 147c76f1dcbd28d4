"""What the colour of residuals, and noise that grows with the signal, make of standard errors."""

from __future__ import annotations

from typing import NamedTuple

from flightid.conventions import Light
from flightid.findings import Finding

UNEQUAL = "residuals-unequal"
"""Code of residuals whose noise grows with what tells the estimates."""
COLOURED = 1.5
"""Ratio of coloured over white standard errors above which residuals count as coloured."""
WELL_TOLD = 5.0
"""Ratio up to which longer intervals hold: noise with a time constant of ten samples makes 4.4."""
LARGEST_RATIO, SMALLEST_RATIO = 50.0, 0.02
"""Ratios of coloured over white standard errors beyond which neither can be believed."""

WORTH_A_WORD = 1.1
"""Ratio of standard errors from which the growth is worth a word."""
IN_DOUBT = 2.0
"""Ratio from which the scores are those of few samples, and bars with them in doubt."""


class Colour(NamedTuple):
    """Ratios of standard errors over all parameters.

    Attributes
    ----------
    smallest, largest : float
        By the colour of the residuals, to those for white ones.
    growth : float
        Largest with noise as it grows with the signal, to those by its mean power; one where it was
        not found to grow.
    """

    smallest: float = 1.0
    largest: float = 1.0
    growth: float = 1.0


def colour_findings(
    smallest: float, largest: float, growth: float = 1.0, *, has_bars: bool = True
) -> list[Finding]:
    """Verdict on the colour of residuals: red where it changes standard errors beyond belief.

    A note where it widens them and the intervals allow for it, amber from `WELL_TOLD` times on.

    Parameters
    ----------
    smallest, largest : float
        Ratio of standard errors to those for white residuals, over all parameters.
    growth : float
        See `Colour`.
    has_bars : bool
        Whether any estimate has an interval that allows for it.

    Example
    -------
    >>> colour_findings(0.9, 1.2)
    []
    """
    grown = _growth_findings(growth, has_bars=has_bars)
    believed = smallest >= SMALLEST_RATIO and largest <= LARGEST_RATIO
    if believed and largest <= COLOURED:
        return grown
    if believed:
        allowed = "are", ", and the intervals allow for it"
        are, bars = allowed if has_bars else ("would be", "")
        said = (
            f"residuals are coloured: standard errors {are} up to {largest:.2g} times those of "
            f"white residuals{bars}"
        )
        if largest <= WELL_TOLD:
            return [Finding("residuals-coloured", Light.GREEN, said), *grown]
        action = "run residual_tests: where inputs still predict them, dynamics are missing"
        return [Finding("residuals-coloured", Light.AMBER, said, action), *grown]
    ratio = largest if largest > LARGEST_RATIO else smallest
    return [
        Finding(
            "colour-absurd",
            Light.RED,
            f"the colour of the residuals makes standard errors {ratio:.2g} times those of white "
            "residuals: neither can be believed",
            "take longer records; look for drifts, pure tones or constant outputs in the residuals",
        )
    ]


def _growth_findings(ratio: float, *, has_bars: bool = True) -> list[Finding]:
    """What noise that grows with the signal makes of standard errors: a note, amber from two on."""
    if ratio < WORTH_A_WORD:
        return []
    are, bars = ("are", ", and the intervals allow for it") if has_bars else ("would be", "")
    said = (
        f"residuals grow with the signal: standard errors {are} up to {ratio:.2g} times those of "
        f"noise of one power throughout{bars}"
    )
    if ratio < IN_DOUBT:
        return [Finding(UNEQUAL, Light.GREEN, said)]
    action = "look at the residuals against the outputs; weigh by what the sensor's noise is"
    return [Finding(UNEQUAL, Light.AMBER, said, action)]
