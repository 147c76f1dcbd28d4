"""Where a response in a closed loop ends: above the power of what excited it, a loop shows itself.

Beyond the last frequency of a sweep command and rate hang together by feedback alone: coherence is
near one, and the quotient is the inverse of the controller, not the vehicle.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.responses.bands import COHERENT, coherent_parts
from flightid.uncertainty.feedback_result import FeedbackTest

STRONG = 0.01
"""Power over the strongest, in equal parts of a decade: below it feedback outweighs a sweep."""
FEWEST = 2
"""Coherent frequencies above the end that make it worth a word."""


class ExcitedResponse(Protocol):
    """What a measured response tells of its inputs' power."""

    @property
    def omega_rad_s(self) -> NDArray[np.float64]:
        """Frequencies, rad/s."""

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names."""

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names."""

    @property
    def coherence(self) -> NDArray[np.float64]:
        """By output, input and frequency."""

    @property
    def random_error(self) -> NDArray[np.float64]:
        """By output, input and frequency, as a share of the magnitude."""

    @property
    def input_spectrum(self) -> NDArray[np.complex128] | None:
        """By two inputs and frequency."""

    @property
    def injected_rad_s(self) -> tuple[float, float] | None:
        """Lowest and highest frequency of what was injected; None where nobody knows."""

    @property
    def loop(self) -> FeedbackTest | None:
        """Whether one was closed."""

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What to know."""


def excited_to(response: ExcitedResponse, input: str) -> float:
    """Highest frequency that excited an input in a closed loop, rad/s.

    Parameters
    ----------
    response : ExcitedResponse
        A `FrequencyResponse`.
    input : str

    Returns
    -------
    float
        Above it ω·S(ω) of the input, or of what was injected where records hold that, stays 20 dB
        below its most; infinite where no loop was closed, or without spectra. A loop that nobody
        declared and no test could rule out counts as closed: above the excitation it would be all
        that is seen.

    Example
    -------
    >>> import numpy as np, flightid as fid
    >>> values = fid.FrequencyResponse.from_values([1.0, 2.0], [1j, 0.1j], inputs=["u"],
    ...                                            outputs=["p"])
    >>> excited_to(values, "u")
    inf
    """
    loop = response.loop
    if response.input_spectrum is None or loop is None:
        return math.inf
    # Outputs without noise feed none back inside the excited band; above it a loop is as strong.
    if loop.loop == "open" and loop.source != "no noise":
        return math.inf
    return min(excited_span(response, input)[1], injected_to(response))


def injected_to(response: ExcitedResponse) -> float:
    """Highest frequency of what was injected, rad/s: a fit takes nothing above it.

    Leakage that excitation and outputs share is as coherent there as a loop. Infinite where nobody
    knows what was injected, or the loop was open.
    """
    loop, known = response.loop, response.injected_rad_s
    if known is None or loop is None or (loop.loop == "open" and loop.source != "no noise"):
        return math.inf
    return known[1]


def injected_from(response: ExcitedResponse) -> float:
    """Lowest frequency of what was injected, rad/s: by way of it nothing is told below.

    Zero where nobody knows what was injected.
    """
    return 0.0 if response.injected_rad_s is None else response.injected_rad_s[0]


def excited_span(response: ExcitedResponse, input: str) -> tuple[float, float]:
    """Lowest and highest frequency of an input's power, rad/s.

    Beyond them ω·S(ω) stays 20 dB below its most; zero and infinity without spectra.
    """
    if response.input_spectrum is None:
        return 0.0, math.inf
    place, omega = response.inputs.index(input), response.omega_rad_s
    level = omega * np.real(response.input_spectrum[place, place])
    strong = omega[level >= STRONG * level.max()]
    return float(strong[0]), float(strong[-1])


def excited_band(
    response: ExcitedResponse, output: str, input: str, minimum: float = COHERENT
) -> tuple[float, float] | None:
    """Widest coherent band of a pair, rad/s, up to where its input was excited; None without."""
    end = excited_to(response, input)
    coherence = response.coherence[response.outputs.index(output), response.inputs.index(input)]
    parts = coherent_parts(response.omega_rad_s, coherence, minimum)
    wide = [(low, min(high, end)) for low, high in parts if min(high, end) > low]
    return max(wide, key=lambda part: part[1] / part[0]) if wide else None


def end_findings(response: ExcitedResponse) -> list[Finding]:
    """A word for each input above whose power its outputs are coherent still."""
    found, loop = [], response.loop
    closed = loop is not None and (loop.loop == "closed" or loop.is_taken_care_of)
    seen = "a closed loop feeds back, and is no response of the vehicle"
    action = "sweep further where the response is wanted there"
    if not closed:
        seen = (
            "a loop, which no test could rule out, may feed back in place of the vehicle's response"
        )
        action += ", or declare loop='open' if nothing moved the inputs after the outputs"
    for place, name in enumerate(response.inputs):
        end = excited_to(response, name)
        above = response.omega_rad_s > end
        coherent = response.coherence[:, place, above] >= COHERENT
        if np.any(np.sum(coherent, axis=1) >= FEWEST):
            found.append(
                Finding(
                    "excitation-ends",
                    Light.GREEN,
                    f"{name} has power to {end:.3g} rad/s ({end / math.tau:.3g} Hz): what is "
                    f"coherent above it {seen}",
                    action,
                )
            )
    return found


def no_band(response: ExcitedResponse) -> list[Finding]:
    """Amber where no pair of a response is coherent in any band; nothing else."""
    pairs = [(y, u) for y in response.outputs for u in response.inputs]
    if any(excited_band(response, *pair) for pair in pairs):
        return []
    return [
        Finding(
            "no-usable-band",
            Light.AMBER,
            f"no band is usable: no neighbouring frequencies with a coherence of {COHERENT:g} or "
            f"more (the largest is {np.max(response.coherence):.2g})",
            "excite more strongly or for longer, inside the band that is asked for",
        )
    ]


def median_percent(random_error: NDArray[np.float64]) -> float | None:
    """Median random error of a pair, %; None where it is as large as the response itself.

    Parameters
    ----------
    random_error : ndarray, shape (n_frequencies,)
        One standard deviation, as a share of the magnitude.

    Example
    -------
    >>> median_percent(np.array([0.02, 0.04, 0.9])), median_percent(np.array([0.1, 7e3, 1e4]))
    (4.0, None)
    """
    middle = float(np.median(random_error))
    return 100.0 * middle if middle < 1.0 else None


def summary_notes(response: ExcitedResponse) -> tuple[str, ...]:
    """What stands below a table of pairs: findings, and words on what it leaves open."""
    lights = map(str, (*response.findings, *no_band(response)))
    return (*lights, *hollow(response), *untold_loop(response))


def untold_loop(response: ExcitedResponse) -> list[str]:
    """Words on a direct estimate of which nobody knows whether a loop bends it."""
    loop = response.loop
    if loop is None or loop.is_known or loop.is_taken_care_of:
        return []
    said = str(loop)
    return [
        f"{said[0].upper()}{said[1:]}. Where one was closed, noise that it fed back bends this "
        "direct estimate, and its bars do not hold that: declare the loop, or take "
        "estimator='instrument' with what was injected."
    ]


def hollow(response: ExcitedResponse) -> list[str]:
    """Words on the pairs that have no `median_percent`; none where all have one."""
    pairs = [
        f"{output}/{name}"
        for row, output in enumerate(response.outputs)
        for column, name in enumerate(response.inputs)
        if median_percent(response.random_error[row, column]) is None
    ]
    if not pairs:
        return []
    return [
        f"No median random error of {', '.join(pairs)}: at half of the frequencies or more the "
        "error is as large as the response, and nothing is known of it there."
    ]
