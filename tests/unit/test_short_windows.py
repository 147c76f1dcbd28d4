"""Windows that a light mode outlasts: said beside the light, with what to do."""

from __future__ import annotations

import pytest

import flightid as fid
from flightid.identification.frequency_domain.bias_findings import judge_windows
from tests.strangers.response_bands import oscillator_record
from tests.strangers.responses import oscillator


@pytest.mark.parametrize(
    ("zeta", "duration_s", "window_s", "said"),
    [
        (0.05, 60.0, "auto", "takes 27 s to die out, the longest window has 12 s: window_s=27.2"),
        (0.05, 20.0, "auto", "outlasts half the record, the longest window has 4 s: a fit of the"),
        (0.05, 60.0, 25.0, ""),
        (0.3, 60.0, "auto", ""),
    ],
)
def test_windows_come_from_the_damping_that_a_fit_finds(
    zeta: float, duration_s: float, window_s: float, said: str
) -> None:
    record = oscillator_record(0, zeta=zeta, duration_s=duration_s, colour=0.0)
    response = fid.estimate_response(record, window_s=window_s)
    limits = fid.identify(oscillator(zeta), response).evidence.limits
    about = [limit for limit in limits if limit.startswith("The mode at 2")]
    assert len(about) == bool(said)
    assert all(said in limit for limit in about)


def test_a_delay_below_zero_ends_no_fit() -> None:
    response = fid.estimate_response(oscillator_record(0, zeta=0.05, duration_s=20.0, colour=0.0))
    path = fid.TransferFunction("y", "u", "K", denominator=("s^2 + d*s + w2",), delay="tau")
    units = {"K": (8.0, "1/s^2"), "d": (0.2, "1/s"), "w2": (4.0, "1/s^2"), "tau": (0.01, "s")}
    known = fid.Parameters([fid.Parameter(name, *each) for name, each in units.items()])
    model = fid.TransferFunctionModel((path,), known)
    assert judge_windows(model, response)
    assert judge_windows(model.with_values({"tau": -0.01}), response) == []
