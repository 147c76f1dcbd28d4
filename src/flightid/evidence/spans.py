"""Bands in which data say something: how wide, and with how much coherence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flightid.conventions import Light
from flightid.evidence.evidence import BAND, COHERENCE, Check
from flightid.frozen import dataclass
from flightid.inspection.thresholds import BAND_GOOD, BAND_LEAST, MINIMUM_COHERENCE
from flightid.inspection.usable_band import NARROW
from flightid.responses import FrequencyResponse
from flightid.responses.bands import coherent_band, coherent_parts

MORE = (
    "fly a sweep or multisine over a decade around the crossover; where one was flown, larger "
    "or in calmer air, or leave the response out"
)
"""Last words of a check of the band: what was seen holds no dynamics."""
MOST_PARTS = 3
"""Unbroken runs of frequencies that are named one by one."""


@dataclass(frozen=True)
class Span:
    """The band of one response.

    Attributes
    ----------
    name : str
        ``"output/input"``, or the output where all inputs count together.
    band_rad_s : tuple of float, or None
        rad/s; None where no two neighbouring frequencies have the coherence.
    coherence : float
        Mean γ² from the lowest to the highest frequency of the band, gaps between them too; over
        all frequencies where there is no band.
    decades : float or None
        Width of the coherent frequencies, gaps left out; None: no gap.
    parts : tuple of (float, float)
        Unbroken runs of coherent frequencies, rad/s; empty: the band has no gap.

    Example
    -------
    >>> Span("p/tau", (1.0, 20.0), 0.9).ratio
    20.0
    """

    name: str
    band_rad_s: tuple[float, float] | None
    coherence: float
    decades: float | None = None
    parts: tuple[tuple[float, float], ...] = ()

    @property
    def ratio(self) -> float:
        """Highest over lowest frequency, gaps left out; one where there is no band."""
        if self.decades is not None:
            return float(10.0**self.decades)
        return 1.0 if self.band_rad_s is None else self.band_rad_s[1] / self.band_rad_s[0]

    def __str__(self) -> str:
        """Name and band."""
        if self.band_rad_s is None:
            return f"{self.name} has no band with coherence"
        parts = self.parts or (self.band_rad_s,)
        if len(parts) > MOST_PARTS:
            low, high = self.band_rad_s
            broken = f"{low:.3g} to {high:.3g} rad/s in {len(parts)} pieces"
            return f"{self.name} {broken}, together {self.ratio:.3g} to 1"
        said = [f"{a:.3g} to {b:.3g}" if b > a else f"{a:.3g}" for a, b in parts]
        return f"{self.name} {' and '.join(said)} rad/s"


def spans_of(response: FrequencyResponse) -> list[Span]:
    """The band of each output, from its coherence with all inputs together.

    Multiple coherence counts: an input that does little for one output may move another.

    Example
    -------
    >>> import numpy as np
    >>> seen = FrequencyResponse.from_values(np.geomspace(1, 10, 21), np.ones(21),
    ...                                      inputs=["a"], outputs=["y"])
    >>> [str(span) for span in spans_of(seen)]
    ['y 1 to 10 rad/s']
    """
    spans = []
    for name, coherence in zip(response.outputs, response.multiple_coherence, strict=True):
        band, decades = coherent_band(response.omega_rad_s, coherence)
        omega = response.omega_rad_s
        inside = np.ones(omega.size, dtype=np.bool_)
        if band is not None:
            inside = (omega >= band[0]) & (omega <= band[1])
        mean = float(np.mean(coherence[inside]))
        spans.append(Span(name, band, mean, decades, tuple(coherent_parts(omega, coherence))))
    return spans


def judge_span(spans: Sequence[Span], *, predicted: bool = False) -> Check:
    """How wide the narrowest band is, by the thresholds of the inspection of logs.

    A model that predicts what it has not seen has shown its dynamics: half a decade is enough then.

    Example
    -------
    >>> judge_span([Span("p/tau", (1.0, 2.0), 0.9)]).light.value
    'amber'
    """
    narrow = min(spans, key=lambda span: span.ratio)
    band = narrow.band_rad_s
    bands = {span.name: span.band_rad_s for span in spans if span.band_rad_s is not None}
    if narrow.ratio >= (BAND_LEAST if predicted else BAND_GOOD).value:
        return Check(
            BAND, Light.GREEN, f"narrowest band: {narrow}", band_rad_s=band, by_response_rad_s=bands
        )
    if narrow.ratio >= BAND_LEAST.value:
        return Check(
            BAND, Light.AMBER, f"{narrow}: less than a decade", MORE, band, by_response_rad_s=bands
        )
    return Check(BAND, Light.AMBER, f"{narrow}: {NARROW}", MORE, band, by_response_rad_s=bands)


def judge_coherence(spans: Sequence[Span]) -> Check:
    """Mean coherence of the worst band.

    Example
    -------
    >>> judge_coherence([Span("p/tau", (1.0, 20.0), 0.9)]).light.value
    'green'
    """
    poor = min(spans, key=lambda span: span.coherence)
    text = f"mean coherence of {poor.name} {poor.coherence:.2f}"
    if poor.coherence >= MINIMUM_COHERENCE.value:
        return Check(COHERENCE, Light.GREEN, f"least {text}")
    return Check(COHERENCE, Light.AMBER, f"{text}, below {MINIMUM_COHERENCE.value:g}", MORE)
