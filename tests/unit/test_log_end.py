"""What a cut end of a log costs: a flight where it ends in the air, nothing where it was over.

An autopilot writes in blocks and its battery is pulled: nearly every log of a whole flight ends
inside a message, and every one of them was amber.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.conventions import Light
from flightid.fleet.refusal import against
from flightid.inspection.flight_phases import FlightPhases
from flightid.inspection.log_end import end_judged, is_aside
from flightid.logs import DataflashWriter
from flightid.logs.log_cut import INSIDE, log_cut
from tests.blackbox_builder import END, blackbox
from tests.old_px4_log import write_sdlog2
from tests.unit.test_ulog import flight

TIME_S = np.arange(0.0, 20.0, 0.1)
ARMED, DISARMED, LANDED, FLYING = 10, 11, 18, 28
WHOLE = "that flight is whole"
AFTER_DISARMED = f"after the vehicle was disarmed: {WHOLE}"
AFTER_FLIGHT = f"after it was last in the air: {WHOLE}"
LOST = "while the vehicle flies: the rest of that flight is lost"


def _log(
    folder: Path, stops_s: float, events: dict[float, int] | None = None, *, cut: bool = True
) -> fid.Log:
    """Of 20 s with the throttle up until an instant, cut inside its last message."""
    writer = DataflashWriter()
    writer.message(0, "ArduCopter V4.5.7 (test)")
    throttle = np.where((TIME_S > 3.0) & (stops_s > TIME_S), 0.4, 0.0)
    writer.add("CTUN", np.round(1e6 * TIME_S), {"ThO": throttle})
    for time_s, number in (events or {}).items():
        writer.add("EV", [round(1e6 * time_s)], {"Id": [number]})
    content = writer.to_bytes()
    path = folder / "a.bin"
    path.write_bytes(content[:-5] if cut else content)
    return fid.read_log(path)


@pytest.mark.parametrize(
    ("stops_s", "events", "light", "said"),
    [
        (12.0, {2.0: ARMED, 13.5: DISARMED}, Light.UNKNOWN, f"6.3 s {AFTER_DISARMED}"),
        (99.0, {2.0: ARMED, 19.5: DISARMED}, Light.UNKNOWN, f"0.3 s {AFTER_DISARMED}"),
        (99.0, {2.0: ARMED}, Light.AMBER, LOST),
        (99.0, {}, Light.AMBER, LOST),
        (99.0, {2.0: ARMED, 2.5: DISARMED, 2.8: ARMED}, Light.AMBER, LOST),
        (12.0, {2.0: ARMED}, Light.UNKNOWN, f"7.9 s {AFTER_FLIGHT}"),
        (17.0, {2.0: ARMED}, Light.AMBER, LOST),  # A dive, or the ground: too short a time to say.
        (12.0, {3.5: FLYING}, Light.AMBER, LOST),  # Throttle down; its detector says that it flies.
        (12.0, {3.5: FLYING, 12.5: LANDED}, Light.UNKNOWN, f"7.9 s {AFTER_FLIGHT}"),
        (0.0, {2.0: ARMED}, Light.UNKNOWN, "whether a flight was to come is not told"),
        (0.0, {2.0: ARMED, 9.0: DISARMED}, Light.UNKNOWN, "10.8 s after the vehicle was disarmed"),
    ],
)  # fmt: skip
def test_a_cut_log_is_amber_only_where_it_ends_in_flight(
    tmp_path: Path, stops_s: float, events: dict[float, int], light: Light, said: str
) -> None:
    log = _log(tmp_path, stops_s, events)
    inspection = fid.inspect_log(log)
    (cut,) = (each for each in inspection.findings if each.code == "log-cut")
    assert cut.light is light
    assert cut.message.startswith(f"{INSIDE} a message")
    assert cut.message.endswith(said)
    assert (cut in against(inspection)) == (light is Light.AMBER)
    if inspection.phases.airborne:
        assert bool(cut.action) == (light is Light.AMBER)
    # And in the same words of the flight.
    assert cut in fid.review_flight(log, inspection=inspection).findings


def test_a_cut_after_the_flight_leaves_the_verdict_as_it_is(tmp_path: Path) -> None:
    whole = fid.inspect_log(_log(tmp_path, 12.0, {2.0: ARMED, 13.5: DISARMED}, cut=False))
    cut = fid.inspect_log(_log(tmp_path, 12.0, {2.0: ARMED, 13.5: DISARMED}))
    (told,) = (each for each in cut.findings if each not in whole.findings)
    assert is_aside(told)
    sound = tuple(each for each in cut.findings if each.light is Light.GREEN)
    assert sound
    good = cut.with_findings((*sound, told))
    assert good.verdict is Light.GREEN
    assert good.findings_on(["p"]) == sound
    assert not against(good)
    assert cut.verdict is whole.verdict
    flies = replace(told, light=Light.AMBER)
    assert cut.with_findings((*sound, flies)).verdict is Light.AMBER
    assert flies in cut.with_findings((*sound, flies)).findings_on(["p"])


def test_of_a_part_of_a_flight_the_cut_takes_nothing(tmp_path: Path) -> None:
    log = _log(tmp_path, 99.0, {2.0: ARMED})
    for span, light in (((4.0, 15.0), Light.UNKNOWN), ((4.0, 30.0), Light.AMBER)):
        (cut,) = (e for e in fid.review_flight(log, span_s=span).findings if e.code == "log-cut")
        assert cut.light is light
    (cut,) = end_judged(log, FlightPhases(((4.0, 19.9),), True, None, ""), log.findings, 15.0)
    assert cut.message.endswith("a message, 4.8 s after the part in question")


def test_a_fall_ends_a_flight(tmp_path: Path) -> None:
    """It lies there; what it did before is in the log."""
    log = _log(tmp_path, 18.0)
    (cut,) = end_judged(log, FlightPhases(((4.0, 17.0),), True, 17.0, ""), log.findings)
    assert cut.light is Light.UNKNOWN
    assert cut.message.endswith(f"a message, 2.8 s after the vehicle fell over: {WHOLE}")


def test_every_reader_leaves_the_light_of_a_cut_to_the_flight(tmp_path: Path) -> None:
    """ULog, Blackbox and PX4's older logs by the same rule; the last said nothing at all."""
    ulog = bytes(flight(20))[:-7]
    box = blackbox({"time": 10_000_000 + 500 * np.arange(64)}).removesuffix(END)
    old = write_sdlog2(tmp_path / "a.px4log").read_bytes()[:-3]
    for name, content in (("a.ulg", ulog), ("a.bfl", box), ("b.px4log", old)):
        path = tmp_path / name
        path.write_bytes(content)
        cut = [each for each in fid.read_log(path).findings if each.code == "log-cut"]
        assert [(each.light, each.action) for each in cut] == [(Light.UNKNOWN, "")], name
    assert cut[0] == log_cut(f"{INSIDE} a message")
