"""What `attitude_bandwidth` found: five numbers with their covariance, and the curve."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.dynamics.handling_qualities.curve import GainPhaseCurve
from flightid.dynamics.handling_qualities.rating import Rating, normal_draws, rate
from flightid.dynamics.handling_qualities.rating_charts import RatingChart
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Table
from flightid.uncertainty.estimate import Estimate, Reading, estimate_table
from flightid.uncertainty.quantiles import shown
from flightid.uncertainty.uncertain import LOST, Uncertain
from flightid.uncertainty.uneven import drawn_estimate

PLACES = {"omega_180": 0, "phase": 1, "gain": 2, "delay": 3, "slope": 4}
Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class AttitudeBandwidth(
    Result,
    schema="flightid.attitude_bandwidth/2",
    untold={"uncertain": "the covariance that quantities carry", "curve": "what a plot draws"},
):
    """Result of `attitude_bandwidth`.

    Attributes
    ----------
    output, input : str
        Attitude (or rate) and control.
    response_type : str
        ``"rate"``: the lesser of both bandwidths counts; ``"attitude"``: that of the phase.
    uncertain : Uncertain
        ω_180, phase bandwidth, gain bandwidth (rad/s), phase delay by two points and by the slope
        of the phase (s), with their covariance; NaN where a finding says why.
    curve : GainPhaseCurve
        The attitude response, for pictures.
    nonlinear : bool
        The phase beyond ω_180 is no line: the slope counts as phase delay, as the standard says.
    findings : tuple of Finding

    Example
    -------
    >>> import flightid as fid
    >>> fid.attitude_bandwidth(fid.load_model("attitude_first_order"), "tau_phi", "phi")
    AttitudeBandwidth(phi/tau_phi, 2.693 rad/s, phase delay 0.01492 s)
    """

    output: str
    input: str
    response_type: str
    uncertain: Uncertain[NDArray[np.float64]]
    curve: GainPhaseCurve
    nonlinear: bool = False
    findings: tuple[Finding, ...] = ()

    @property
    def name(self) -> str:
        """``"output/input"``."""
        return f"{self.output}/{self.input}"

    def _value(self, name: str) -> float | None:
        value = float(self.uncertain.numbers[PLACES[name]])
        return value if np.isfinite(value) else None

    @property
    def omega_180_rad_s(self) -> float:
        """Where the phase passes −180°, rad/s."""
        return float(self.uncertain.numbers[PLACES["omega_180"]])

    @property
    def phase_bandwidth_rad_s(self) -> float:
        """Where the phase passes −135°, 45° before instability, rad/s."""
        return float(self.uncertain.numbers[PLACES["phase"]])

    @property
    def gain_bandwidth_rad_s(self) -> float | None:
        """Where the gain is 6 dB above that at ω_180, rad/s; None where a finding says why."""
        return self._value("gain")

    @property
    def phase_delay_s(self) -> float | None:
        """Fall of phase from ω_180 to its double, s; None where a finding says why."""
        return self._value("delay")

    @property
    def phase_slope_delay_s(self) -> float | None:
        """The same from the least-squares slope of the phase there, s."""
        return self._value("slope")

    @property
    def gain_limited(self) -> bool:
        """Whether the gain bandwidth is the lesser."""
        gain = self.gain_bandwidth_rad_s
        return gain is not None and gain < self.phase_bandwidth_rad_s

    @property
    def bandwidth_rad_s(self) -> float:
        """Bandwidth that counts for the response type, rad/s."""
        gain = self.gain_bandwidth_rad_s
        if self.response_type == "attitude" or gain is None:
            return self.phase_bandwidth_rad_s
        return min(self.phase_bandwidth_rad_s, gain)

    @property
    def rated_delay_s(self) -> float | None:
        """Phase delay that counts, s: by the slope where the phase is no line."""
        return self.phase_slope_delay_s if self.nonlinear else self.phase_delay_s

    def samples(self) -> dict[str, Array]:
        """Draws of ``bandwidth`` (rad/s) and ``phase_delay`` (s); empty without a covariance."""
        places = [PLACES["phase"]]
        if self.response_type == "rate" and self.gain_bandwidth_rad_s is not None:
            places.append(PLACES["gain"])
        if self.rated_delay_s is not None:
            places.append(PLACES["slope" if self.nonlinear else "delay"])
        covariance = self.uncertain.covariance
        drawn = normal_draws(
            self.uncertain.numbers[places],
            None if covariance is None else covariance[np.ix_(places, places)],
        )
        if drawn is None:
            return {}
        late = self.rated_delay_s is not None
        found = {"bandwidth": np.min(drawn[: len(places) - late], axis=0)}
        return {**found, "phase_delay": drawn[-1]} if late else found

    @property
    def bandwidth(self) -> Reading:
        """Bandwidth that counts, with the interval of the lesser of both."""
        drawn = self.samples().get("bandwidth")
        if drawn is None:
            known = self.uncertain.covariance is not None
            reason = LOST if known else self.uncertain.reason
            return Estimate("bandwidth", self.bandwidth_rad_s, "rad/s", None, reason)
        return drawn_estimate(
            "bandwidth", self.bandwidth_rad_s, "rad/s", drawn, "without end within its uncertainty"
        )

    @property
    def quantities(self) -> tuple[Reading, ...]:
        """All numbers with their intervals."""
        missing = {finding.code: finding.message for finding in self.findings}
        made = self.uncertain.number
        return (
            self.bandwidth,
            made(0, "ω_180", "rad/s"),
            made(1, "phase bandwidth", "rad/s"),
            made(2, "gain bandwidth", "rad/s", missing.get("gain-bandwidth", "")),
            made(3, "phase delay", "s", missing.get("phase-delay", "")),
            made(4, "phase delay by slope", "s", missing.get("phase-slope", "")),
        )

    def rate(self, chart: RatingChart) -> Rating | None:
        """Level on a chart of bandwidth and phase delay; None without a phase delay."""
        delay = self.rated_delay_s
        if delay is None:
            return None
        values = {"bandwidth": self.bandwidth_rad_s, "phase_delay": delay}
        return rate(chart, values, self.samples(), subject=self.name)

    def __repr__(self) -> str:
        """Bandwidth and phase delay on one line."""
        late = self.rated_delay_s
        delay = "unknown" if late is None else f"{late:.4g} s"
        return (
            f"AttitudeBandwidth({self.name}, {self.bandwidth_rad_s:.4g} rad/s, phase delay {delay})"
        )

    def summary(self, *, level: float | None = None) -> Table:
        """Table of all values with intervals at a level."""
        level = shown(level)
        title = f"Attitude bandwidth of {self.name}, {self.response_type} command"
        return estimate_table(title, self.quantities, tuple(map(str, self.findings)), level=level)

    def _computed(self) -> dict[str, object]:
        return {
            "omega_180_rad_s": self.omega_180_rad_s,
            "phase_bandwidth_rad_s": self.phase_bandwidth_rad_s,
            "gain_bandwidth_rad_s": self.gain_bandwidth_rad_s,
            "bandwidth_rad_s": self.bandwidth_rad_s,
            "phase_delay_s": self.phase_delay_s,
            "phase_slope_delay_s": self.phase_slope_delay_s,
            "gain_limited": self.gain_limited,
            "quantities": {each.name: each for each in self.quantities},
        }
