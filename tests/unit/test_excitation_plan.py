"""Plans: verdicts that an expert would give, sizes that keep limits, files that autopilots read."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightid import excitation
from flightid.cli import design as design_command
from flightid.cli.program import run
from flightid.errors import ModelError, OptionError
from flightid.excitation import Limits, Plan, RateAxis
from flightid.excitation.design import KINDS
from flightid.plot.excitation import excitation_history, plan_spectrum
from tests.closeness import assert_close
from tests.examples import examples

AXIS = RateAxis(
    gain=40.0, time_constant_s=0.2, delay_s=0.01, rate_feedback=0.1, attitude_feedback_per_s=4.0
)
TEMPLATE = {
    "magnitude": 0.15, "start_hz": 0.05, "stop_hz": 5.0, "record_s": 130.0, "fade_in_s": 5.0,
    "fade_out_s": 5.0,
}  # fmt: skip


def _findings(plan: Plan, code: str) -> list[str]:
    return [str(finding) for finding in plan.findings if finding.code == code]


def test_a_lead_moves_the_slowest_pole_as_its_polynomial_says() -> None:
    led = RateAxis(gain=8.0, time_constant_s=1.0, lead_s=0.2, rate_feedback=0.25)
    slow = RateAxis(gain=8.0, time_constant_s=1.0, rate_feedback=0.25)
    assert_close(led.slowest_s(), (1.0 + 2.0 * 0.2) / 3.0, rtol=1e-9, why="s + 1 + 2 (0.2 s + 1)")
    assert_close(slow.slowest_s(), 1.0 / 3.0, rtol=1e-9, why="s + 1 + 2")


def test_template_of_the_methodic_configurator_is_seen_through() -> None:
    chirp = excitation.ardupilot_chirp(**TEMPLATE)
    plan = excitation.assess(chirp, AXIS, n_records=1)
    (dwell,) = _findings(plan, "chirp-dwell")
    assert "40 s of 130 s dwell at 0.05 Hz" in dwell
    assert "Methodic Configurator" in dwell
    assert "sweep takes 90 s, 31.5 s of it above 1 Hz" in dwell
    assert "3.87 Hz of 5 Hz" in _findings(plan, "chirp-fade-out")[0]
    assert "50 s without any excitation" in _findings(plan, "chirp-silent-end")[0]
    assert not _findings(plan, "chirp-fade-in")
    assert not plan.is_go
    assert "[red] no window holds two cycles" in _findings(plan, "design-windows")[0]


def test_default_of_copter_fades_in_beyond_its_dwell() -> None:
    chirp = excitation.ardupilot_chirp(
        magnitude=0.1, start_hz=0.5, stop_hz=40.0, record_s=70.0, fade_in_s=15.0, fade_out_s=2.0
    )
    plan = excitation.assess(chirp, AXIS)
    assert "up to 1.04 Hz" in _findings(plan, "chirp-fade-in")[0]
    assert not _findings(plan, "chirp-dwell")


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_every_kind_keeps_the_limits_by_default(kind: str) -> None:
    limits = Limits(control=0.5, control_rate_per_s=60.0, attitude_rad=0.3)
    band = (4.0, 30.0 if kind != "multisine" else 9.0)
    plan = excitation.plan(kind, AXIS, band_rad_s=band, limits=limits)
    axis = plan.axes[0]
    shares = [
        axis.peak_control / limits.control,
        axis.peak_control_rate / 60.0,
        axis.peak_rate_rad_s / limits.rate_rad_s,
        axis.peak_attitude_rad / limits.attitude_rad,
    ]
    assert 0.79 < max(shares) <= 0.8 * (1 + 1e-9)


@pytest.mark.parametrize("kind", ["sweep", "ardupilot_chirp", "multisine", "noise", "prbs"])
def test_a_sensible_request_is_a_go(kind: str) -> None:
    plan = excitation.plan(kind, AXIS, band_rad_s=(1.0, 30.0 if kind != "multisine" else 12.0))
    assert plan.is_go, plan.summary()
    assert len(plan.windows_s) == 5
    assert "go" in repr(plan)
    assert "Windows [s]" in str(plan.summary())
    json.dumps(plan.to_dict(), allow_nan=False)


@examples(15)
@given(amplitude=st.floats(0.001, 0.5), factor=st.floats(1.1, 4.0))
def test_predictions_are_proportional_and_bounds_inverse(amplitude: float, factor: float) -> None:
    small, large = (
        excitation.plan(
            "noise", AXIS, band_rad_s=(2.0, 20.0), amplitude=size, sample_rate_hz=100.0
        ).axes[0]
        for size in (amplitude, amplitude * factor)
    )
    assert_close(large.peak_attitude_rad, factor * small.peak_attitude_rad, rtol=1e-9, why="linear")
    assert small.stderr is not None
    assert large.stderr is not None
    assert_close(np.array(small.stderr), factor * np.array(large.stderr), rtol=1e-9, why="linear")


def test_too_much_amplitude_is_red_and_says_how_much_less() -> None:
    plan = excitation.plan("sweep", AXIS, band_rad_s=(1.0, 30.0), amplitude=1.0)
    (attitude,) = _findings(plan, "design-attitude")
    assert attitude.startswith("[red]")
    cut = float(attitude.split("reduce the amplitude by ")[1].split()[0])
    again = excitation.plan("sweep", AXIS, band_rad_s=(1.0, 30.0), amplitude=1 - cut / 100)
    assert _findings(again, "design-attitude")[0].startswith("[green]")


def test_weak_slow_short_and_narrow_designs_are_told() -> None:
    weak = excitation.plan("sweep", AXIS, band_rad_s=(1.0, 30.0), amplitude=1e-6)
    assert _findings(weak, "design-coherence")[0].startswith("[red]")
    assert _findings(weak, "design-bound")[0].startswith("[amber]")
    slow = excitation.plan("sweep", AXIS, band_rad_s=(1.0, 60.0), sample_rate_hz=60.0)
    assert _findings(slow, "design-sample-rate")[0].startswith("[red]")
    short = excitation.plan("noise", AXIS, band_rad_s=(1.0, 30.0), duration_s=10.0)
    assert _findings(short, "design-record-length")[0].startswith("[red]")
    steps = excitation.plan("doublet", AXIS, band_rad_s=(2.0, 20.0))
    assert _findings(steps, "design-transient")
    narrow = excitation.assess(
        excitation.noise(
            band_rad_s=(1.0, 3.0), amplitude=0.1, duration_s=60.0, sample_rate_hz=200.0, seed=0
        ),
        AXIS,
        band_rad_s=(1.0, 30.0),
    )
    assert _findings(narrow, "design-coverage")[0].startswith("[red]")


def test_correlated_inputs_are_red_and_orthogonal_ones_green() -> None:
    good = excitation.plan("multisine", AXIS, band_rad_s=(4.0, 8.0), inputs=("a", "b"))
    assert _findings(good, "design-inputs-correlated")[0].startswith("[green]")
    one = good.excitation.signals[0]
    twin = excitation.Excitation(
        np.vstack([one, one]), good.excitation.sample_time_s, ("a", "b"), "1", "copy", (4.0, 8.0)
    )
    bad = excitation.assess(twin, {"a": AXIS, "b": AXIS})
    assert _findings(bad, "design-inputs-correlated")[0].startswith("[red]")


def test_a_record_that_starts_off_trim_is_told() -> None:
    time_s = np.arange(6000) / 200
    cosine = excitation.Excitation(
        0.1 * np.cos(5 * time_s)[None, :], 0.005, ("u",), "1", "tone", (2.0, 10.0)
    )
    assert (
        "starts or ends at 0.1"
        in _findings(excitation.assess(cosine, AXIS), "design-ends-out-of-trim")[0]
    )


def test_one_tone_cannot_tell_the_parameters_apart() -> None:
    time_s = np.arange(8000) / 200
    whole = 2 * math.pi * 8 / 40
    tone = excitation.Excitation(
        0 * time_s[None, :] + 0.1 * np.sin(whole * time_s), 0.005, ("u",), "1", "tone", (1.0, 2.0)
    )
    quick = RateAxis(gain=5.0, time_constant_s=1e-3)
    plan = excitation.assess(tone, quick)
    assert plan.axes[0].stderr is None or max(plan.axes[0].stderr) > 1e-3


def test_plans_refuse() -> None:
    with pytest.raises(OptionError, match="no such kind of design"):
        excitation.plan("dance", AXIS, band_rad_s=(1.0, 30.0))
    with pytest.raises(OptionError, match="this kind of design excites one input"):
        excitation.plan("sweep", AXIS, band_rad_s=(1.0, 30.0), inputs=("a", "b"))
    with pytest.raises(OptionError, match="very long record"):
        excitation.plan("sweep", AXIS, band_rad_s=(0.01, 30.0))
    made = excitation.doublet(amplitude=0.1, step_s=0.5, sample_rate_hz=50.0)
    with pytest.raises(OptionError, match="an input has no guess"):
        excitation.assess(made, {"v": AXIS})
    with pytest.raises(OptionError, match="no record is flown"):
        excitation.assess(made, AXIS, n_records=0)
    with pytest.raises(ModelError, match="the guessed loop is unstable"):
        excitation.assess(made, RateAxis(gain=40.0, time_constant_s=0.2, rate_feedback=-0.1))
    with pytest.raises(ModelError, match="the guessed loop is unstable"):
        RateAxis(gain=40.0, time_constant_s=0.2, delay_s=0.1, rate_feedback=0.5).slowest_s()
    with pytest.raises(OptionError, match="absolute_gain must be positive"):
        RateAxis(gain=0.0, time_constant_s=0.2)
    with pytest.raises(
        OptionError, match=r"attitude_rad is too small: found 0.0; needed a number above 0"
    ):
        Limits(attitude_rad=0.0)
    with pytest.raises(OptionError, match="low must be positive"):
        excitation.window_lengths((0.0, 1.0), 10.0, 1)


def test_windows_follow_the_rules() -> None:
    windows = excitation.window_lengths((1.0, 20.0), 90.0, 2)
    assert_close(windows[0], 36.0, rtol=1e-12, why="a fifth of 180 s, less than half of 90 s")
    assert_close(windows[-1], 20 * 2 * np.pi / 20, rtol=1e-12, why="twenty fastest cycles")
    assert excitation.window_lengths((0.3, 20.0), 90.0, 2) == ()
    assert excitation.window_lengths((1.0, 3.0), 60.0, 4) == (30.0,)


def test_csv_reads_back_to_twelve_digits(tmp_path: Path) -> None:
    made = excitation.ardupilot_chirp(**{**TEMPLATE, "magnitude": 5.0}, axis=7, sample_rate_hz=50.0)
    path = excitation.write_csv(made, tmp_path / "chirp.csv")
    assert path.read_text().splitlines()[0] == "time_s,excitation [deg/s]"
    read = np.loadtxt(path, delimiter=",", skiprows=1)
    assert_close(read[:, 0], made.time_s, atol=1e-9, why="twelve digits")
    assert_close(read[:, 1], made.signals[0], atol=1e-10, why="twelve digits")


def test_pictures_show_every_input() -> None:
    plan = excitation.plan("multisine", AXIS, band_rad_s=(4.0, 8.0), inputs=("a", "b"))
    assert [trace.name for trace in excitation_history(plan.excitation).data] == ["a", "b"]
    made = plan_spectrum(plan)
    assert len(made.data) == 6
    assert made.layout.xaxis.type == "log"


COMMAND = [
    "design", "ardupilot_chirp", "--band", "1", "30", "--gain", "40", "--time-constant", "0.2",
    "--rate-feedback", "0.1", "--attitude-feedback", "4", "--axis", "11",
]  # fmt: skip


def test_command_designs_and_exports(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = [tmp_path / name for name in ("a.csv", "a.html")]
    options = ["--write", str(files[0]), "--html", str(files[1])]
    assert run([*COMMAND, *options, "--json"]) == 0
    shown = capsys.readouterr()
    assert json.loads(shown.out)["go"] is True
    assert shown.err.count("Wrote") == 2
    assert "Go or no-go" in files[1].read_text()


def test_a_sweep_is_not_told_to_become_one() -> None:
    short = excitation.plan("sweep", AXIS, band_rad_s=(1.0, 60.0), amplitude=0.05)
    (said,) = _findings(short, "design-coverage")
    assert "[amber]" in said
    assert "lengthen the record" in said
    longer = excitation.plan(
        "sweep", AXIS, band_rad_s=(1.0, 60.0), amplitude=0.05, duration_s=120.0
    )
    assert "[green]" in _findings(longer, "design-coverage")[0]


def test_command_leaves_with_one_for_no_go(capsys: pytest.CaptureFixture[str]) -> None:
    assert run([*COMMAND, "--amplitude", "3"]) == 1
    assert "[red]" in capsys.readouterr().out


def test_command_offers_every_kind() -> None:
    assert set(design_command.Kinds().choices) == set(KINDS)


def test_a_rig_that_nobody_guesses_gets_its_input_without_a_verdict(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ["design", "prbs", "--band-hz", "0.05", "2", "--rate", "10", "--duration", "60"]
    file, page = tmp_path / "prbs.csv", tmp_path / "prbs.html"
    written = ["--write", str(file), "--html", str(page)]
    assert run([*asked, "--amplitude", "0.2", *written]) == 0
    said = capsys.readouterr()
    assert "coverage of band" in said.out
    assert "go" not in said.out.split("coverage")[0].split()
    assert "not judged" in said.err
    samples = np.loadtxt(file, delimiter=",", skiprows=1)
    assert set(samples[:, 1]) == {-0.2, 0.2}
    assert "how often it has each size" in page.read_text(encoding="utf-8")
    assert "Go or no-go" not in page.read_text(encoding="utf-8")
    assert run(asked) == 2
    assert "--amplitude" in capsys.readouterr().err
    assert run([*asked, "--amplitude", "0.2", "--gain", "1"]) == 2, "half a guess is asked for"
