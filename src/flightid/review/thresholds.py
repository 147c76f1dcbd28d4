"""Every number that a verdict of the review rests on, with where it comes from."""

from __future__ import annotations

from flightid.inspection.thresholds import Threshold

FASTEST_RATE = Threshold(
    100, "Hz", "ten samples in the 0.1 s in which the rate loop of a middle-sized multirotor rises"
)
FASTEST_ATTITUDE = Threshold(
    50, "Hz", "ten samples in the 0.2 s in which the attitude of a middle-sized multirotor rises"
)
LIVELY_RATE = Threshold(
    0.5, "rad/s", "30 deg/s rms: quick sticks; a loop that follows them shows in half a minute"
)
LIVELY_ATTITUDE = Threshold(0.17, "rad", "10 deg rms: quick sticks, as above")
SAMPLES_IN_RISE = Threshold(
    3, "1", "a step that rises within fewer logged samples is drawn by interpolation, not by data"
)
COHERENT = Threshold(
    0.2, "1", "coherence below which a set-point counts as not seen (ours, on simulated flights)"
)
RISE_BAND = Threshold(
    0.4,
    "1",
    "rise time times the band that a step needs: 0.35 of a pole, 0.45 of a damped pair; slower "
    "set-points held 0 of 22 rise times, quicker ones 26 of 30 (ours)",
)
WIDEST_LEVEL = Threshold(
    0.5, "1", "half of the step either way, or of its level: such a step tells nothing about gains"
)
WIDEST_DELAY = Threshold(
    9,
    "1",
    "latest over earliest: a delay that may be a third or three times its value. Of 108 steps of "
    "flights of 12 s 4 went beyond, one with a rise time 3.4 times off; of 7 from 3 to 9 all "
    "intervals of delay and rise held; of 7 steps of real logs none went beyond 4.7 (ours)",
)
WIDEST_TRACKING = Threshold(
    3, "1", "a tracking error that may be a third or three times its value tells no loop (ours)"
)
OVERSHOOT = Threshold(
    31, "%", "a pair of poles damped by 0.35, the least of level 1: MIL-F-8785C, 3.2.2.1.2"
)
LEVEL_OFF = Threshold(
    0.15,
    "1",
    "of what is asked: a loop with an integrator ends at one; less is wind and fits (ours)",
)
BEYOND = Threshold(
    0.05, "1", "of the samples: errors beyond proportion that gusts make, among small moves (ours)"
)
LEFT = Threshold(
    0.25,
    "1",
    "of the set-point's deviation: less, left in small moves, tells gusts. Of yaws of a simulated "
    "ArduCopter .03 to .21 missed their levels by up to 0.25 and by their bars, .33 to .58 by .01",
)
VIBE_GOOD = Threshold(
    30, "m/s^2", "ArduPilot, Measuring Vibration: below 30 m/s/s is normally acceptable"
)
VIBE_BAD = Threshold(
    60, "m/s^2", "ArduPilot, Measuring Vibration: above 60 m/s/s nearly always has problems"
)
PX4_VIBRATION_GOOD = Threshold(
    4.905, "m/s^2", "PX4 Flight Review, Vibration Metrics: green below half of g"
)
PX4_VIBRATION_BAD = Threshold(9.81, "m/s^2", "PX4 Flight Review, Vibration Metrics: red above g")
SATURATED = Threshold(
    0.05, "1", "of the flight at the upper limit: no room left to hold attitude in that time"
)
UNBALANCED = Threshold(
    0.15, "1", "of the mean command between the most and the least loaded motor in still hover"
)
OUTPUT_NOISE = Threshold(
    0.01, "1", "of full command, rms: three deviations move a motor by some 5 % of its range (ours)"
)
PHASE_TO_WIN = Threshold(
    3, "deg", "a fifteenth of the 45 deg of phase margin that a loop is designed for (ours)"
)
