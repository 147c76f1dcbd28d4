"""The two grey boxes in both domains, and how well they predict what they have not seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from vehicles import COMMANDS, RATES, grey_box

import flightid as fid
from flightid.errors import FitError

HOLD = "zero"
"""The log has every loop, and the autopilot holds its commands for a loop."""
BAND_RAD_S = (0.4, 30.0)
BOXES = ("roll_pitch", "yaw")
SWEEPS = {"roll_pitch": slice(0, 2), "yaw": slice(2, 3)}


@dataclass(frozen=True)
class Refusal:
    """A fit that the data do not allow, and why."""

    reason: str


@dataclass(frozen=True)
class Identified:
    """Both grey boxes from one flight.

    Attributes
    ----------
    time, frequency : dict of str to Fit
        By grey box, in the time and in the frequency domain.
    """

    time: dict[str, fid.Fit]
    frequency: dict[str, fid.Fit]

    @property
    def values(self) -> dict[str, float]:
        """Estimates of both boxes in the time domain."""
        return {n: p.value for fit in self.time.values() for n, p in fit.parameters.items()}


def identify(sweeps: Sequence[fid.Record], *, starts: int, seed: int) -> Identified:
    """Fit both boxes to the three sweeps, from random starts inside the bounds.

    Parameters
    ----------
    sweeps : sequence of Record
        Of roll, pitch and yaw.
    starts : int
        Number of starts of each fit in the time domain.
    seed : int
        Of the starts.
    """
    time, frequency = {}, {}
    for name in BOXES:
        records = sweeps[SWEEPS[name]]
        time[name] = fid.identify(grey_box(name), records, hold=HOLD, starts=starts, seed=seed)
        frequency[name] = in_frequency(name, records)
    return Identified(time, frequency)


def in_frequency(name: str, records: Sequence[fid.Record]) -> fid.Fit:
    """Estimate the responses with the chirps as instruments, and fit the box to them."""
    inputs, outputs = (COMMANDS[:2], RATES[:2]) if name == "roll_pitch" else (("tau_psi",), ("r",))
    response = fid.estimate_response(
        records,
        inputs=inputs,
        outputs=outputs,
        excitations=[f"sweep_{each}" for each in inputs],
        estimator="instrument",
        band_rad_s=BAND_RAD_S,
        n_omega=50,
    )
    box = grey_box(name)
    effects = dict(zip([p for p in box.parameters if "t" in p], box.pairs, strict=True))
    signs = {
        # b/(s - a) lags by 90 degrees at high frequency where b is positive.
        parameter: -100.0 * float(np.sign(np.mean(response.pair(*pair.split("/")).response.imag)))
        for parameter, pair in effects.items()
    }
    return fid.identify(box.with_values(signs), response, hold=HOLD)


def attempt(records: Sequence[fid.Record], **structure: bool) -> fid.Fit | Refusal:
    """Fit roll and pitch to whatever there is; a refusal is an answer too."""
    try:
        return fid.identify(grey_box("roll_pitch", **structure), records, hold=HOLD)
    except FitError as error:
        return Refusal(f"{error.problem}: {error.found}")


def mse(fit: fid.Fit, place: int, rate: str) -> float:
    """Mean square of measured minus modelled rate over a training record, (rad/s)²."""
    return float(fit.records[place].rms[rate] ** 2)


def predict(fit: fid.Fit, records: Sequence[fid.Record]) -> fid.Verification:
    """Predict records that the fit has not seen, from their inputs alone."""
    return fid.verify(fit, list(records), output_bias=False, hold=HOLD)
