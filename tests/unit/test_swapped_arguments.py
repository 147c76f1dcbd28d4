"""Arguments the wrong way round end in a typed error that says what to do."""

from __future__ import annotations

from collections.abc import Callable

import pytest

import flightid as fid

RECORD = fid.Record.from_arrays(
    [0.0, 0.5, 1.0], inputs={"tau_phi": [0.0, 1.0, 2.0]}, outputs={"p": [0.0, 1.0, 2.0]}
)
MODEL = fid.load_model("rate_first_order", axis="roll")


@pytest.mark.parametrize(
    ("call", "advice"),
    [
        (lambda: fid.verify(RECORD, MODEL), "the model or fit first"),
        (lambda: fid.verify(MODEL, MODEL), "the model or fit first"),
        (lambda: fid.predict(MODEL, [MODEL]), "the model or fit first"),
        (lambda: fid.write_records("flight.nc", RECORD), "what is to be written first"),
        (lambda: fid.write_model("roll.toml", MODEL), "what is to be written first"),
        (lambda: fid.write_system("roll.json", MODEL), "what is to be written first"),
        (
            lambda: fid.write_px4_parameters("roll.params", {"P": 1.0}),
            "what is to be written first",
        ),
        (lambda: fid.plot.bode(MODEL), r"call \.plot\(\)"),
    ],
)
def test_the_error_says_the_order(call: Callable[[], object], advice: str) -> None:
    with pytest.raises(fid.FlightidError, match=advice):
        call()
