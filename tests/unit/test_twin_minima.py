"""Twin minima of a fit to responses: more starts change no number, and the twin is said."""

from __future__ import annotations

import flightid as fid
from tests.closeness import assert_close


def test_more_starts_keep_the_answer_and_name_its_twin() -> None:
    """A rate with a motor's lag has a twin whose two poles are exchanged."""
    model = fid.load_model("rate_motor_lag", axis="roll")
    truth = {"Ltphi": 140.0, "Lp": -3.4, "T_m": 0.045, "tau": 0.012}
    sweep = fid.excitation.sweep(
        band_rad_s=(0.5, 40.0), amplitude=0.1, duration_s=60.0, sample_rate_hz=100.0, name="tau_phi"
    )
    sticks = fid.Record.from_arrays(sweep.time_s, inputs=sweep.by_name)
    noise = fid.Noise(sensor={"p": 0.02}, seed=0)
    record = fid.simulate(model.with_values(truth), sticks, units=model.units, noise=noise)
    response = fid.estimate_response(record, band_rad_s=(1.0, 40.0), n_omega=60)
    one, many = (fid.identify(model, response, starts=starts) for starts in (1, 10))
    assert len(one.minima) == 1
    for name, parameter in one.parameters.items():
        assert_close(many.parameters[name].value, parameter.value, rtol=1e-4, why="the same search")
    twin = many.minima[1]
    assert_close(twin.objective, many.objective, rtol=1e-3, why="the same response")
    assert_close(-1.0 / twin.values["T_m"], one.parameters["Lp"].value, rtol=1e-2, why="a twin")
    codes = [{f.code for f in fit.findings} & {"several-minima"} for fit in (one, many)]
    assert codes == [set(), {"several-minima"}]
