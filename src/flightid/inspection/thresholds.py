"""Every number that a verdict of the inspection rests on, with where it comes from."""

from __future__ import annotations

from flightid.frozen import dataclass


@dataclass(frozen=True)
class Threshold:
    """A limit with its source.

    Attributes
    ----------
    value : float
        The limit.
    unit : str
        Its unit.
    source : str
        Book, paper, format or reasoning.

    Example
    -------
    >>> MINIMUM_COHERENCE.value
    0.6
    """

    value: float
    unit: str
    source: str


MINIMUM_COHERENCE = Threshold(
    0.6, "1", "Tischler & Remple, Aircraft and Rotorcraft System Identification, 2nd ed., ch. 7"
)
INDEPENDENT_WINDOWS = Threshold(5, "1", "Tischler & Remple: window at most a fifth of the record")
CYCLES_IN_WINDOW = Threshold(
    2, "1", "two cycles of the lowest frequency, as a sweep that starts with two full cycles"
)
LOWEST_OF_INTEREST = Threshold(
    0.3, "Hz", "2 rad/s: a decade below the 20 rad/s at which rate loops of multirotors cross over"
)
LONGEST_WINDOW = Threshold(
    40,
    "s",
    "two cycles at 0.05 Hz (0.3 rad/s), where sweeps of aircraft begin (Tischler & Remple, "
    "ch. 5); a longer flight gives more windows, which settle the coherence",
)
SAMPLES_PER_CYCLE = Threshold(
    10, "1", "gain and phase of a sampled-and-held signal stay within 2 % and 18 deg of the signal"
)
SAMPLES_PER_CYCLE_LEAST = Threshold(
    5, "1", "above a fifth of the sampling rate only aliases remain"
)
RATE_GOOD = Threshold(
    100, "Hz", "25 samples a cycle at 4 Hz (sampling rate at least 25 times the highest frequency)"
)
RATE_LEAST = Threshold(30, "Hz", "10 samples a cycle at 3 Hz, where rate loops cross over")
OF_SWEEP = Threshold(
    0.75, "1", "of the last frequency of a logged sweep: above it the fade-out takes its power"
)
EXCITED_POWER = Threshold(
    0.01, "1", "20 dB below the strongest: below it noise and harmonics in a loop outweigh a sweep"
)
BAND_GOOD = Threshold(10, "1", "a decade around crossover fixes gain, lag and delay separately")
BAND_LEAST = Threshold(3, "1", "half a decade: gain and delay, no dynamics")
GAP_FACTOR = Threshold(2.5, "1", "median spacings; the same limit as the resampling's gap policy")
JITTER = Threshold(0.2, "1", "of the median interval: above it resampling needs interpolation")
SATURATED_SHARE = Threshold(0.05, "1", "of the flight: more bends the linear estimate noticeably")
RESTING_RATE = Threshold(
    0.05, "rad/s", "3 deg/s rms: what a steady hover in light wind shows without any input"
)
AIRBORNE_THRUST = Threshold(
    0.05, "1", "throttle above which a multirotor's motors do more than idle"
)
AIRBORNE_SHARE = Threshold(
    0.5, "1", "of the median throttle in use: less does not carry the weight"
)
AIRBORNE_SPEED = Threshold(6, "m/s", "slower than the stall speed of the smallest model aeroplanes")
SHORTEST_SEGMENT = Threshold(2, "s", "shorter hops hold no window of two cycles above 1 Hz")
LYING_TILT = Threshold(0.52, "rad", "30 deg: nothing rests so unless it has fallen over")
LYING_RATE = Threshold(0.1, "rad/s", "attitude no longer changes")
TIPPING_TILT = Threshold(0.35, "rad", "20 deg: the fall is counted from the last passage")
GYRO_RANGE = Threshold(34.2, "rad/s", "98 % of the 2000 deg/s at which common gyroscopes clip")
SKEW = Threshold(0.004, "s", "14 deg of phase at 10 Hz")
SKEW_CORRELATION = Threshold(0.9, "1", "below it two streams do not show the same motion")
GROWTH = Threshold(
    8, "1", "three doublings within one piece of steady growth: gusts and sticks come and go"
)
DIVERGED_RATE = Threshold(0.5, "rad/s", "29 deg/s rms beside the set-point: no loop that flies")
DIVERGED_ANGLE = Threshold(0.35, "rad", "20 deg rms beside the set-point: no loop that flies")
