"""Models flown beside a clock: the same samples as `simulate`, late frames counted, hostile UDP."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys

import numpy as np
import pytest

import flightid as fid
from flightid.cli.program import run
from flightid.errors import DataError, OptionError, UnknownNameError
from flightid.simulation.noise import linear_disturbance
from flightid.simulation.realtime import MOST_A_FRAME, UdpLink, fly_in_real_time, fly_model
from flightid.simulation.stepper import Stepper
from tests.closeness import assert_close

STEP_S = 0.02
SYSTEM = fid.LinearSystem(
    [[-1.0, 3.0], [-4.0, -0.5]], [[1.0], [0.0]], np.eye(2), np.zeros((2, 1)), ("u",), ("p", "q"),
    [0.033],
)  # fmt: skip


class FakeClock:
    def __init__(self, cost_s: float = 0.0, slow_from: int = 10**9) -> None:
        self.time_s, self.asked, self._cost_s, self._slow_from = 100.0, 0, cost_s, slow_from

    def now(self) -> float:
        self.asked += 1
        if self.asked > self._slow_from:
            self.time_s += self._cost_s
        return self.time_s

    def sleep(self, seconds: float) -> None:
        assert seconds > 0.0
        self.time_s += seconds


def stick(t: float, outputs: object) -> dict[str, float]:
    return {"u": 0.1 * np.sin(3.0 * t) + 0.05}


def test_gusts_and_noise_in_the_loop_are_those_of_a_simulation() -> None:
    """The same draws: an unstable vehicle under gusts, sample by sample and all at once."""
    helicopter = fid.load_model("ah64_hover")
    noise = fid.Noise(
        sensor={"q": 0.01}, process={"p": 0.02}, gusts={"u": (3.0, 2.0), "w": (1.0, 1.0)}, seed=7
    )
    stepper = Stepper(helicopter, STEP_S, noise=noise)
    session = fly_in_real_time(
        stepper, lambda t, seen: {"lon": 0.1}, duration_s=12.0, clock=FakeClock()
    )
    calm = fly_in_real_time(
        Stepper(helicopter, STEP_S), lambda t, seen: {"lon": 0.1}, duration_s=12.0,
        clock=FakeClock(),
    )  # fmt: skip
    found = session.record.matrix(stepper.outputs) - calm.record.matrix(stepper.outputs)
    wanted = linear_disturbance(helicopter, noise, STEP_S, 600) + noise.on_sensors(
        stepper.outputs, 600
    )
    scale = np.abs(wanted).max(axis=1, keepdims=True)
    assert_close(found / scale, wanted / scale, atol=1e-9, why="the same recursion and draws")
    with pytest.raises(UnknownNameError, match="gravity"):
        Stepper(helicopter, STEP_S, noise=fid.Noise(gusts={"gravity": (1.0, 1.0)}))


def test_linear_flight_is_exact() -> None:
    session = fly_in_real_time(Stepper(SYSTEM, STEP_S), stick, duration_s=4.0, clock=FakeClock())
    wanted = fid.simulate(SYSTEM, session.record, hold="zero").matrix(("p", "q"))
    found = session.record.matrix(("p", "q"))
    # Before the flight the stick was at rest in the air and at its first value in `simulate`.
    first = SYSTEM.sampled(STEP_S)
    assert_close(found, fid.simulate(first, session.record).matrix(("p", "q")), atol=1e-13,
                 why="the same recursion")  # fmt: skip
    assert np.abs(found - wanted).max() < 0.02
    assert session.late_frames == 0
    assert repr(session) == "FlownSession(200 frames, 0 late)"
    assert session.to_dict()["frames"] == 200
    assert "worst delay" in str(session.summary())


def test_an_interrupt_ends_the_flight_and_keeps_it() -> None:
    def leaving(t: float, outputs: object) -> dict[str, float]:
        if t > 1.0:
            raise KeyboardInterrupt
        return stick(t, outputs)

    session = fly_in_real_time(Stepper(SYSTEM, STEP_S), leaving, duration_s=4.0, clock=FakeClock())
    assert repr(session) == "FlownSession(51 frames, 0 late, stopped by hand)"
    with pytest.raises(KeyboardInterrupt):
        fly_in_real_time(
            Stepper(SYSTEM, STEP_S), lambda t, y: leaving(9.0, y), duration_s=4.0, clock=FakeClock()
        )


def test_equations_fly_as_simulate_does() -> None:
    model = fid.load_model("quadrotor_6dof").with_fixed(tau_d=2 * STEP_S)
    hover = model.trim["F"]

    def pilot(t: float, outputs: object) -> dict[str, float]:
        return {"F": hover, "tau_phi": 0.01 * np.sin(4.0 * t)}

    session = fly_in_real_time(Stepper(model, STEP_S), pilot, duration_s=0.6, clock=FakeClock())
    wanted = fid.simulate(model, session.record, hold="zero")
    for name in ("p", "phi"):
        scale = np.abs(wanted[name]).max()
        assert_close(session.record[name] / scale, wanted[name] / scale, atol=1e-10,
                     why="the same Runge-Kutta steps on whole delays")  # fmt: skip


def test_parts_of_a_sample_of_delay_keep_the_mean() -> None:
    model = fid.load_model("quadrotor_6dof").with_fixed(tau_d=0.5 * STEP_S)
    hover = model.trim["F"]
    pilot = lambda t, y: {"F": hover, "tau_phi": 0.01 * np.sin(4.0 * t)}  # noqa: E731
    session = fly_in_real_time(Stepper(model, STEP_S), pilot, duration_s=0.6, clock=FakeClock())
    wanted = fid.simulate(model, session.record, hold="zero")
    scale = np.abs(wanted["p"]).max()
    assert_close(session.record["p"] / scale, wanted["p"] / scale, atol=5e-3,
                 why="area kept, first moment not")  # fmt: skip


def test_late_frames_are_counted_and_flown() -> None:
    clock = FakeClock(cost_s=1.5 * STEP_S, slow_from=50)
    session = fly_in_real_time(Stepper(SYSTEM, STEP_S), stick, duration_s=2.0, clock=clock)
    assert session.record.n_samples == 100
    assert 40 < session.late_frames < 60
    assert session.worst_late_s > 0.2


def test_augmentation_damps_and_limits_hold() -> None:
    unstable = fid.LinearSystem([[0.5]], [[1.0]], [[1.0]], [[0.0]], ("u",), ("p",))
    kick = lambda t, y: {"u": 1.0 if t < 0.1 else 0.0}  # noqa: E731
    bare = fly_in_real_time(Stepper(unstable, STEP_S), kick, duration_s=6.0, clock=FakeClock())
    damped = Stepper(unstable, STEP_S, feedback={"u": {"p": -2.0}})
    held = fly_in_real_time(damped, kick, duration_s=6.0, clock=FakeClock())
    assert bare.record["p"][-1] > 1.0
    assert abs(held.record["p"][-1]) < 1e-3
    limited = Stepper(SYSTEM, STEP_S, limits={"u": (-0.02, 0.02)})
    one = fly_in_real_time(limited, lambda t, y: {"u": 9.0}, duration_s=2.0, clock=FakeClock())
    other = fly_in_real_time(Stepper(SYSTEM, STEP_S), lambda t, y: {"u": 0.02}, duration_s=2.0,
                             clock=FakeClock())  # fmt: skip
    assert np.array_equal(one.record["p"], other.record["p"])


def test_what_cannot_be_flown() -> None:
    with pytest.raises(OptionError, match="sample time is not positive"):
        Stepper(SYSTEM, 0.0)
    with pytest.raises(OptionError, match="sample time of its own"):
        Stepper(SYSTEM.sampled(0.1), 0.2)
    with pytest.raises(OptionError, match="limits of u cross"):
        Stepper(SYSTEM, STEP_S, limits={"u": (1.0, 0.0)})
    with pytest.raises(UnknownNameError, match="no such output"):
        Stepper(SYSTEM, STEP_S, feedback={"u": {"z": 1.0}})
    with pytest.raises(UnknownNameError, match="no such input"):
        Stepper(SYSTEM, STEP_S).step({"v": 1.0})
    with pytest.raises(DataError, match="an input is not finite"):
        Stepper(SYSTEM, STEP_S).step({"u": float("nan")})
    wild = Stepper(fid.LinearSystem([[9e3]], [[1.0]], [[1.0]], [[0.0]], ("u",), ("y",)), STEP_S)
    assert wild.step({"u": 1.0}) == {"y": 0.0}
    with pytest.raises(DataError, match="the model diverges"):
        wild.step({"u": 1.0})
    with pytest.raises(OptionError, match="no usable length"):
        fly_in_real_time(Stepper(SYSTEM, STEP_S), stick, duration_s=float("inf"))


def test_datagrams_in_and_out() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as cockpit:
        cockpit.bind(("127.0.0.1", 0))
        cockpit.settimeout(5.0)
        there = ("127.0.0.1", cockpit.getsockname()[1])
        with UdpLink(["u"], listen=("127.0.0.1", 0), send=there) as link:
            hostile = [b"\xff", b"[1]", b'{"v": 1}', b'{"u": NaN}', b'{"u": "x"}', b'{"u": true}',
                       b"[" * 5000, b'{"u": 1e99}']  # fmt: skip
            for data in (b'{"u": 0.25}', *hostile):
                cockpit.sendto(data, ("127.0.0.1", link.port))
            found: dict[str, float] = {}
            for _ in range(1000):
                found = link.pilot(0.0, {})
                if link.rejected == len(hostile):
                    break
            assert found == {"u": 0.25}
            assert link.rejected == len(hostile)
            link.show(0.5, {"p": 1.5})
            assert json.loads(cockpit.recv(1000)) == {"time_s": 0.5, "p": 1.5}
        with UdpLink(["u"], send=there, style="flightgear") as link:
            link.show(0.5, {"p": 1.5, "q": -0.25})
            assert cockpit.recv(1000) == b"1.5\t-0.25\n"
    with pytest.raises(OptionError, match="style is not known"):
        UdpLink(["u"], style="morse")


def test_fly_from_the_command_line(tmp_path, capsys, monkeypatch) -> None:
    path, before, ended_by = tmp_path / "flown.nc", signal.getsignal(signal.SIGTERM), []

    def flown(*arguments: object, **options: object) -> object:
        ended_by.append(signal.getsignal(signal.SIGTERM))
        return fly_model(*arguments, **options)

    monkeypatch.setattr("flightid.simulation.realtime.fly_model", flown)
    words = ["fly", "short_period", "--duration", "0.1", "--rate", "50", "--listen", "0"]
    assert (
        run(
            [
                *words,
                "--feedback",
                "elevator=q:0.1:alpha:0.2",
                "--limits",
                "elevator=-0.3:0.3",
                "--write",
                str(path),
                "--json",
            ]
        )
        == 0
    )
    said = capsys.readouterr()
    plain = json.loads(said.out)
    assert (plain["frames"], plain["options"]["limits"]) == (5, {"elevator": [-0.3, 0.3]})
    assert "Listening at 127.0.0.1" in said.err
    assert ended_by == [signal.default_int_handler], "a signal ends it as Ctrl-C does"
    assert signal.getsignal(signal.SIGTERM) is before
    assert fid.read_records(path)[0].n_samples == 5
    for wrong, words_said in (
        (["--feedback", "elevator=q"], "needed INPUT=OUTPUT:GAIN"),
        (["--send", "nowhere"], "needed HOST:PORT"),
        (["--write", str(tmp_path / "no" / "a.nc")], "there is no folder"),
        (["--write", str(tmp_path / "a.csv")], "neither .parquet nor .nc"),
    ):
        assert run(["fly", "short_period", *wrong]) == 2
        assert words_said in capsys.readouterr().err


def test_the_first_sound_sender_is_the_pilot_and_a_frame_takes_a_bounded_count() -> None:
    with UdpLink(["u"], listen=("127.0.0.1", 0)) as link:
        pilot, other = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        with pilot, other:
            there = ("127.0.0.1", link.port)
            other.sendto(b"nonsense", there)
            other.sendto(b"{}", there)
            pilot.sendto(b'{"u": 0.5}', there)
            other.sendto(b'{"u": 9.0}', there)
            assert link.pilot(0.0, {}) == {"u": 0.5}
            assert (link.rejected, link.strangers) == (2, 1)
            for _ in range(2 * MOST_A_FRAME):
                other.sendto(b'{"u": 9.0}', there)
            pilot.sendto(b'{"u": 0.25}', there)
            pilot.sendto(b'{"u": 1e7}', there)
            assert link.pilot(0.1, {}) == {"u": 0.25}
            assert link.rejected == 3
            for _ in range(3 * MOST_A_FRAME):
                pilot.sendto(b"nonsense", there)
            link.pilot(0.2, {})
            assert link.rejected <= 3 + MOST_A_FRAME


FLOOD = """
import socket, sys, time
out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
there, sent, begun = ("127.0.0.1", int(sys.argv[1])), 0, time.monotonic()
while (gone := time.monotonic() - begun) < float(sys.argv[2]):
    for _ in range(200):
        out.sendto(b'{"u": 9.0}', there)
    sent += 200
    time.sleep(max(0.0, sent / 1e5 - gone))
"""


def _flooded(at_the_link: bool) -> tuple[fid.Record, int, float]:
    """Ten seconds at 400 frames/s while 10⁵ datagrams/s arrive at the link, or beside it."""
    with (
        UdpLink(["u"], listen=("127.0.0.1", 0)) as link,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as pilot,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as beside,
    ):
        beside.bind(("127.0.0.1", 0))
        pilot.sendto(b'{"u": 0.5}', ("127.0.0.1", link.port))
        port = link.port if at_the_link else beside.getsockname()[1]
        flood = subprocess.Popen([sys.executable, "-c", FLOOD, str(port), "10"])
        session = fly_in_real_time(Stepper(SYSTEM, 1.0 / 400.0), link.pilot, duration_s=10.0)
        flood.wait()
    return session.record, session.late_frames, session.worst_late_s


@pytest.mark.nightly
def test_400_frames_a_second_stay_on_time_in_a_flood() -> None:
    _, usual, _ = _flooded(at_the_link=False)
    record, late, worst_s = _flooded(at_the_link=True)
    assert (record["u"] == 0.5).all()
    assert late < 2 * usual + 0.05 * record.n_samples
    assert worst_s < 0.25
