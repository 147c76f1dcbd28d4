"""A manoeuvre that was flown twice: what the run that was kept back says of agreement."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import flightid as fid
from flightid.conventions import Light
from flightid.evidence.evidence import AGREEMENT, BAND, Check, Evidence
from flightid.evidence.part_checks import AGAIN, agreement_check
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.study.evidence import examined
from flightid.study.kept_runs import agreement_of_kept
from flightid.uncertainty.agreement import Agreement

BAND_RAD_S = (3.0, 56.0)
RATES = SimpleNamespace(inputs=("tau",), outputs=("p",))
LOGGED = SimpleNamespace(inputs=("tau_phi",), outputs=("p",))
GUIDE, POOR = (
    Finding("verification-theil", Light.GREEN, "p: Theil coefficient 0.1"),
    Finding("verification-theil", Light.RED, "p: Theil coefficient 0.6", "fit both"),
)


def swept(from_hz: float, to_hz: float) -> fid.Record:
    """A chirp that is logged beside what it moves."""
    time_s = np.arange(0.0, 60.0, 0.005)
    rise = math.log(to_hz / from_hz) if to_hz > from_hz else 1.0
    phase = math.tau * from_hz * 60.0 / rise * np.expm1(rise * time_s / 60.0)
    chirp = np.sin(phase) if to_hz > from_hz else np.zeros_like(time_s)
    return fid.Record.from_arrays(
        time_s, inputs={"tau": chirp}, outputs={"p": chirp}, excitations={"sweep": chirp}
    )


@dataclass(frozen=True)
class Fitted:
    """As much of a fit as is examined."""

    evidence: Evidence
    agreement: Agreement
    model: Any
    findings: tuple[Finding, ...] = ()
    responses: tuple[str, ...] = ("p/tau",)


def judged(unseen: fid.Record | None, said: Finding = GUIDE, n_records: int = 1) -> Check:
    """The check on agreement of one fitted run, with another record to verify on."""
    found = Agreement(n_records, None, None, np.ones(1))
    checks = (
        Check(BAND, Light.GREEN, "3 to 56 rad/s", band_rad_s=BAND_RAD_S),
        agreement_check(found),
    )
    run = SimpleNamespace(
        predictions=(SimpleNamespace(measured=unseen),),
        fit_percent={"p": 73.6},
        findings=(said,),
        horizon="free_run",
    )
    runs = {} if unseen is None else {"roll sweep 2": run}
    item = SimpleNamespace(
        tests=None, untested=(), unfitted=(), verifications=runs, on_unseen=runs,
        reduction_judged=(), training=(), response=None, findings_of_choice=(),
    )  # fmt: skip
    made = examined(Fitted(Evidence(checks), found, RATES), item, None)  # type: ignore[arg-type]
    check = made.evidence.check(AGREEMENT)
    assert check is not None
    return check


def test_a_second_sweep_that_verifies_shows_whether_flights_agree() -> None:
    """Every axis that was flown in two runs, as a plan asks, read "flown once … repeat it"."""
    check = judged(swept(0.2, 12.0))
    assert check.light is Light.GREEN
    assert check.what == (
        "one run was fitted, the second was kept to verify: the model predicts 73.6 % of p there"
    )
    assert "of that flight alone" in check.limit, "one fitted run has intervals of one flight"


def test_a_second_sweep_that_is_missed_leaves_agreement_in_doubt() -> None:
    check = judged(swept(0.2, 12.0), POOR)
    assert (check.light, check.action) == (Light.UNKNOWN, "fit both")
    assert "in doubt" in check.what
    assert "flown once" not in check.what


@pytest.mark.parametrize(
    "unseen",
    [None, swept(6.0, 12.0), swept(0.0, 0.0)],
    ids=["none", "the end of a sweep", "plain flying"],
)
def test_what_is_no_second_sweep_shows_no_agreement(unseen: fid.Record | None) -> None:
    check = judged(unseen)
    assert (check.light, check.action) == (Light.UNKNOWN, AGAIN)
    assert check.what.startswith("flown once")


def test_several_fitted_records_speak_for_themselves() -> None:
    assert judged(swept(0.2, 12.0), n_records=2).what.startswith("records are not compared")


def test_one_sweep_of_a_log_names_the_plan_of_another() -> None:
    once = agreement_check(Agreement(1, None, None, np.ones(1)))
    fit = Fitted(Evidence((once,)), Agreement(1, None, None, np.ones(1)), LOGGED)
    found = SimpleNamespace(axis="roll", kind="sid", is_sweep=True)
    log = SimpleNamespace(vehicle="copter", name="one.BIN", excitations=(found,))
    (check,) = agreement_of_kept(fit, {}, (), log)  # type: ignore[arg-type]
    assert check.what == once.what
    assert check.action == f"{AGAIN}: flightid plan one.BIN --axes roll"
