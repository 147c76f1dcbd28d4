"""Margins: what they say, what they refuse, how they are shown."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid.control.margins.findings import guide_finding
from flightid.errors import DataError, ModelError, OptionError, ShapeError, UnknownNameError
from flightid.uncertainty.estimate import Estimate


def loop(gain=4.0, delay=0.1):
    return fid.LinearSystem([[0.0]], [[gain]], [[1.0]], [[0.0]], ("e",), ("y",), [delay])


def measured(gain=4.0, error=0.02, coherence=0.95, n=60):
    omega = np.geomspace(0.5, 40.0, n)
    shape = (1, 1, n)
    return fid.FrequencyResponse.from_values(
        omega,
        loop(gain).frequency_response(omega),
        inputs=["e"],
        outputs=["y"],
        random_error=np.full(shape, error),
        coherence=np.full(shape, coherence),
    )


def codes(found):
    return {each.code: each.light.value for each in found.findings}


def test_an_unstable_loop_says_so_in_red_with_negative_margins():
    found = fid.margins(loop(20.0))
    assert codes(found)["closed-loop-unstable"] == "red"
    assert not found.is_stable
    assert found.unstable_poles == 2
    assert found.phase_margin.value < 0
    assert found.gain_margin.value < 0
    assert found.delay_margin.value < 0
    assert repr(found).startswith("Margins(y / e: unstable with 2 poles, phase -")


def test_guides_are_judged_at_the_worse_end():
    assert codes(fid.margins(measured()))["phase-margin"] == "green"
    doubtful = fid.margins(measured(error=0.8))
    assert codes(doubtful)["phase-margin"] == "amber"
    assert codes(fid.margins(measured(9.0)))["phase-margin"] == "red"
    pm = Estimate("peak", 4.0, "dB", 1.02)
    found = guide_finding(pm, 5.0, "peak", "lower the gain", at_least=False)
    assert (found.light.value, "to 6" in found.message) == ("amber", True)
    assert guide_finding(pm, 3.0, "peak", "", at_least=False).light.value == "red"
    assert guide_finding(pm, 7.0, "peak", "", at_least=False).light.value == "green"


def test_what_there_is_not_has_a_reason():
    found = fid.margins(fid.LinearSystem([[-1.0]], [[0.5]], [[1.0]], [[0.0]], ("e",), ("y",)))
    assert found.phase_margin.value is None
    assert found.phase_margin.reason == "the gain does not pass one in the band"
    assert "no rise of the gain" in found.gain_margin.reason
    assert codes(found)["no-crossover"] == "unknown"
    assert codes(found)["no-intervals"] == "unknown"
    assert "without a covariance" in found.sensitivity_peak.reason


def test_all_crossings_are_kept():
    mode = fid.LinearSystem(
        [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [2.0, -400.0, -0.4]],
        [[1.0], [0.0], [0.0]],
        [[2.0, 0.0, 40.0]],
        [[0.0]],
        ("e",),
        ("y",),
    )
    found = fid.margins(mode)
    assert len(found.crossovers) == 3
    table = found.crossing_table()
    assert len(table.rows) == len(found.crossovers) + len(found.phase_crossovers)
    assert [row[0] for row in table.rows] == sorted(row[0] for row in table.rows)
    worst = min(found.crossovers, key=lambda each: abs(each.margin))
    assert found.crossover.value == pytest.approx(worst.omega_rad_s)


def test_low_coherence_at_the_crossover_is_told():
    # One point that chance made less coherent than its neighbours is read, and said.
    dipped = measured(error=0.3, coherence=np.where(np.arange(60) == 28, 0.5, 0.7))
    assert codes(fid.margins(dipped))["coherence-at-crossover"] == "amber"
    with pytest.raises(DataError, match="too few coherent frequencies"):
        fid.margins(measured(coherence=0.4))


def test_open_poles_of_a_measurement_are_asked_for():
    omega = np.geomspace(0.05, 60.0, 200)
    values = 4 * np.exp(-0.05j * omega) / (1j * omega - 1)
    seen = fid.FrequencyResponse.from_values(omega, values, inputs=["e"], outputs=["y"])
    assert codes(fid.margins(seen))["nyquist-criterion-contradicted"] == "amber"
    told = fid.margins(seen, unstable_poles=1)
    assert "nyquist-criterion-contradicted" not in codes(told)
    assert told.gain_reduction_margin.value == pytest.approx(20 * np.log10(4), abs=0.02)
    assert "closed-loop-unstable" in codes(fid.margins(seen, unstable_poles=3))


def test_views():
    found = fid.margins(measured())
    text = found.summary().to_text()
    assert "phase margin" in text
    assert "95 % low" in text
    assert "<table>" in found._repr_html_()
    plain = found.to_dict()
    assert plain["schema"] == "flightid.margins/1"
    assert plain["phase_margin"]["interval95"][0] < found.phase_margin.value
    assert len(found.curve.stderr_deg) == len(found.curve.omega_rad_s)


def test_a_band_limits_what_is_looked_at():
    found = fid.margins(loop(), band_rad_s=(1.0, 10.0))
    assert found.curve.omega_rad_s[[0, -1]] == pytest.approx([1.0, 10.0])
    assert found.phase_margin.value == pytest.approx(fid.margins(loop()).phase_margin.value)
    assert [each.omega_rad_s for each in found.phase_crossovers] == []
    assert fid.margins(measured(), band_rad_s=(1.0, 10.0)).gain_margin.value is None


def test_what_is_no_loop_is_refused():
    with pytest.raises(OptionError, match="given is not known"):
        fid.margins(loop(), given="open")
    with pytest.raises(OptionError, match="band_rad_s has no meaning"):
        fid.margins(loop(), band_rad_s=(2.0, 1.0))
    with pytest.raises(OptionError, match="only a measured response may be given"):
        fid.margins(loop(), given="closed")
    with pytest.raises(ModelError, match="the loop has no frequency response"):
        fid.margins("loop")
    with pytest.raises(UnknownNameError, match="there is no such output"):
        fid.margins(loop(), "e", "p")
    two = fid.LinearSystem([[-1.0]], [[1.0, 2.0]], [[1.0]], [[0.0, 0.0]], ("e", "f"), ("y",))
    with pytest.raises(OptionError, match="the loop has several inputs"):
        fid.margins(two)
    with pytest.raises(ShapeError, match="the controller does not fit the loop"):
        fid.margins(loop(), controller=two)
    with pytest.raises(ShapeError, match="values of a controller have no frequencies"):
        fid.margins(loop(), controller=np.ones(3))
    with pytest.raises(DataError, match="too few frequencies"):
        fid.margins(measured(), band_rad_s=(1.0, 1.1))
    omega = [1.0, 2.0, 3.0]
    one = fid.FrequencyResponse.from_values(omega, [1.0, 0.5, 0.2], inputs=["r"], outputs=["e"])
    with pytest.raises(DataError, match="a sensitivity is zero or one"):
        fid.margins(one, given="sensitivity")


def unstable(gain: float) -> fid.LinearSystem:
    """Loop of gain · 2/((s − 0.5)(s + 4)): its gain at zero frequency is `gain`."""
    return fid.LinearSystem(
        [[0.0, 1.0], [2.0, -3.5]], [[0.0], [2.0 * gain]], [[1.0, 0.0]], [[0.0]], ("e",), ("y",)
    )


@pytest.mark.parametrize("band", [None, (0.001, 30.0), (2.0, 30.0)])
def test_a_real_unstable_pole_limits_the_fall_of_the_gain(band):
    found = fid.margins(unstable(3.5), band_rad_s=band)
    assert found.is_stable
    assert found.gain_reduction_margin.value == pytest.approx(20 * np.log10(3.5), abs=1e-4)
    assert found.gain_reduction_crossing.value == 0.0
    # Just above that limit the closed loop is stable, just below it is not.
    for gain, stable in ((1.001, True), (0.999, False)):
        assert fid.margins(unstable(gain), band_rad_s=band).is_stable is stable


def test_a_measurement_says_nothing_of_gains_below_its_band():
    omega = np.geomspace(2.0, 30.0, 80)
    values = unstable(3.5).frequency_response(omega)
    seen = fid.FrequencyResponse.from_values(omega, values, inputs=["e"], outputs=["y"])
    found = fid.margins(seen, unstable_poles=1)
    assert found.gain_reduction_margin.value is None
    assert "cannot be said" in found.gain_reduction_margin.reason


def test_a_nearer_limit_outside_the_band_is_told():
    near, far = 20 * np.log10(np.pi / 2 / 0.4), 20 * np.log10(5 * np.pi / 2 / 0.4)
    found = fid.margins(loop(), band_rad_s=(20.0, 200.0))
    assert found.gain_margin.value == pytest.approx(far, abs=1e-3)
    (said,) = [each for each in found.findings if each.code == "gain-limit-outside-band"]
    assert f"{near:.3g} dB at 15.7 rad/s" in said.message
    assert "gain-limit-outside-band" not in codes(fid.margins(loop()))
