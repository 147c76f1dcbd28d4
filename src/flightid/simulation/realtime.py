"""A pilot flies a model: a fixed step beside the clock, inputs and outputs by UDP."""

from __future__ import annotations

import json
import math
import socket
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from types import TracebackType
from typing import Protocol, Self

import numpy as np

from flightid.errors import DataError, OptionError
from flightid.frozen import dataclass
from flightid.record import Record
from flightid.result import Result
from flightid.simulation.fly_options import FlyOptions
from flightid.simulation.noise import Noise
from flightid.simulation.stepper import Controller, Stepper
from flightid.table import Column, Table

MAXIMUM_DATAGRAM = 8192
MOST_A_FRAME = 128
"""Datagrams taken in one frame: reading them takes well below the 2.5 ms of 400 frames a second."""
RECEIVE_BUFFER = 1 << 16
"""Bytes that wait at the port; fewer datagrams than are taken in a frame, so none is old."""
LARGEST_INPUT = 1e6
FEWEST_FRAMES, MAXIMUM_FRAMES = 2, 10_000_000


class Clock(Protocol):
    """What time it is, and waiting."""

    def now(self) -> float:
        """Seconds from any origin; never goes back."""

    def sleep(self, seconds: float) -> None:
        """Wait."""


class EndOfFlight(Exception):  # noqa: N818 — no error, as StopIteration is none
    """Raised by a pilot, or by who is shown the outputs: the flight ends and is kept."""


class SystemClock:
    """The machine's monotonic clock."""

    def now(self) -> float:
        """Seconds."""
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        """Wait."""
        time.sleep(seconds)


@dataclass(frozen=True, eq=False)
class FlownSession(Result, schema="flightid.flown_session/1", untold={"record": "time histories"}):
    """A flight in real time.

    Attributes
    ----------
    record : Record
        Inputs of the pilot and outputs of the model.
    late_frames : int
        Frames that began later than their instant by more than a tenth of a sample.
    worst_late_s : float
        Longest delay of a frame, s.
    stopped : bool
        Whether an interrupt or its pilot ended it before its time.
    options : mapping of str to object
        As they were used; empty where the loop was driven by hand.
    """

    record: Record
    late_frames: int
    worst_late_s: float
    stopped: bool = False
    options: Mapping[str, object] = field(default_factory=dict)

    def __repr__(self) -> str:
        """Frames and late ones on one line."""
        stopped = ", stopped by hand" if self.stopped else ""
        return f"FlownSession({self.record.n_samples} frames, {self.late_frames} late{stopped})"

    def summary(self) -> Table:
        """Table of the frames."""
        rows = (
            ("frames", float(self.record.n_samples), ""),
            ("late frames", float(self.late_frames), ""),
            ("worst delay", 1e3 * self.worst_late_s, "ms"),
        )
        title = f"Flight of {self.record.n_samples} frames"
        return Table(title, (Column("what"), Column("value"), Column("unit")), rows)

    def _computed(self) -> dict[str, object]:
        return {"frames": self.record.n_samples}


def fly_in_real_time(
    stepper: Stepper,
    pilot: Callable[[float, Mapping[str, float]], Mapping[str, float]],
    *,
    duration_s: float,
    show: Callable[[float, Mapping[str, float]], None] | None = None,
    clock: Clock | None = None,
    units: Mapping[str, str] | None = None,
) -> FlownSession:
    """Step a model beside a clock; frames that come late are counted, none is left out.

    An interrupt (Ctrl-C), or `EndOfFlight` raised by the pilot or by `show`, ends the flight: what
    was flown until then is returned.

    Parameters
    ----------
    stepper : Stepper
    pilot : callable
        Takes the time, s, and the last outputs; returns inputs by name.
    duration_s : float
        Of the flight, s.
    show : callable, optional
        Takes the time and the outputs, each frame.
    clock : Clock, optional
        Left out: the machine's.
    units : mapping of str to str, optional
        Of channels, for the record.

    Raises
    ------
    OptionError
        A duration without meaning.
    DataError
        The model diverges, or the pilot gives what is no number.
    UnknownNameError
        The pilot moves what is no input.
    KeyboardInterrupt, EndOfFlight
        Before two frames were flown.

    Example
    -------
    >>> from flightid.models import LinearSystem
    >>> lag = LinearSystem([[-1.0]], [[1.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    >>> fly_in_real_time(Stepper(lag, 0.01), lambda t, y: {"u": 1.0}, duration_s=0.05).record
    Record('flown', 5 samples, 100 Hz, 0.05 s, inputs [u], outputs [y])
    """
    beat, step = clock or SystemClock(), stepper.sample_time_s
    count = round(duration_s / step) if math.isfinite(duration_s) else 0
    if not FEWEST_FRAMES <= count <= MAXIMUM_FRAMES:
        raise OptionError(
            "the flight has no usable length",
            found=f"{duration_s:g} s",
            needed="two samples or more",
        )
    given = np.empty((len(stepper.inputs), count))
    found = np.empty((len(stepper.outputs), count))
    outputs: Mapping[str, float] = dict.fromkeys(stepper.outputs, 0.0)
    start, late_frames, worst, flown = beat.now(), 0, 0.0, 0
    try:
        for k in range(count):
            wait = start + k * step - beat.now()
            if wait > 0.0:
                beat.sleep(wait)
            else:
                worst = max(worst, -wait)
                late_frames += -wait > 0.1 * step
            inputs = {**stepper.rest, **pilot(k * step, outputs)}
            outputs = stepper.step(inputs)
            given[:, k] = [inputs[name] for name in stepper.inputs]
            found[:, k] = list(outputs.values())
            flown = k + 1
            if show is not None:
                show(k * step, outputs)
    except (KeyboardInterrupt, EndOfFlight):
        if flown < FEWEST_FRAMES:
            raise
    known = {name: unit for name, unit in (units or {}).items()
             if name in (*stepper.inputs, *stepper.outputs)}  # fmt: skip
    record = Record.from_arrays(
        np.arange(flown) * step,
        inputs=dict(zip(stepper.inputs, given[:, :flown], strict=True)),
        outputs=dict(zip(stepper.outputs, found[:, :flown], strict=True)),
        units=known,
        name="flown",
    )
    return FlownSession(record, late_frames, worst, flown < count)


def fly_model(
    model: object,
    options: FlyOptions,
    *,
    controller: Controller | None = None,
    noise: Noise | None = None,
    say: Callable[[str], None] | None = None,
) -> FlownSession:
    """Fly a model beside the clock, its pilot and its cockpit on the other ends of UDP.

    Parameters
    ----------
    model : what `Stepper` takes
    options : FlyOptions
    controller : Controller, optional
        Moves inputs beside the pilot.
    noise : Noise, optional
        Gusts, process and sensor noise of a linear model.
    say : callable, optional
        Takes a sentence on where it listens, and one on what it could not deliver.

    Raises
    ------
    FlightidError
        As `Stepper` and `fly_in_real_time`.
    OSError
        The port is taken.

    Example
    -------
    >>> from flightid.models import LinearSystem
    >>> lag = LinearSystem([[-1.0]], [[1.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    >>> fly_model(lag, FlyOptions(duration_s=0.05)).options["style"]
    'json'
    """
    stepper = Stepper(
        model, options.step_s(model), feedback=options.gains, limits=options.bounds,
        controller=controller, noise=noise,
    )  # fmt: skip
    heard = None if options.listen is None else (options.host, options.listen)
    with UdpLink(stepper.inputs, listen=heard, send=options.cockpit, style=options.style) as link:
        if say is not None and heard is not None:
            say(f"Listening at {options.host}:{link.port} for {', '.join(stepper.inputs)}")
        session = fly_in_real_time(
            stepper, link.pilot, duration_s=options.duration_s, show=link.show,
            units=getattr(model, "units", None),
        )  # fmt: skip
        if say is not None and link.rejected:
            say(f"{link.rejected} datagrams were damaged or not delivered.")
        if say is not None and link.strangers:
            say(f"{link.strangers} datagrams came from another sender than the pilot.")
    return replace(session, options=options.to_dict())


class UdpLink:
    """A pilot and a cockpit on the other end of UDP.

    Datagrams in are JSON objects of numbers by input, such as ``{"lat": 0.1}``; the newest counts
    and holds until the next. Whoever sends the first sound datagram is the pilot of this flight:
    the system drops what others send from then on. A frame takes `MOST_A_FRAME` datagrams at most,
    and values lie within `LARGEST_INPUT`. Datagrams out are JSON, or lines of tab-separated numbers
    that FlightGear's generic protocol reads.

    Parameters
    ----------
    inputs : sequence of str
        What may be moved.
    listen : tuple of str and int, optional
        Address and port to listen at; port 0 takes a free one.
    send : tuple of str and int, optional
        Where outputs go.
    style : {"json", "flightgear"}
        Of datagrams out.

    Raises
    ------
    OptionError
        Another style.
    OSError
        The port is taken.

    Example
    -------
    >>> with UdpLink(["lat"]) as link:
    ...     link.pilot(0.0, {})
    {}
    """

    def __init__(
        self,
        inputs: Sequence[str],
        *,
        listen: tuple[str, int] | None = None,
        send: tuple[str, int] | None = None,
        style: str = "json",
    ) -> None:
        if style not in ("json", "flightgear"):
            raise OptionError("style is not known", found=style, needed="'json' or 'flightgear'")
        self._inputs, self._style, self._send = tuple(inputs), style, send
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._cockpit = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._cockpit.setblocking(False)
        self._listens = listen is not None
        if listen is not None:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
            self._socket.bind(listen)
        self._sender: object = None
        self._held: dict[str, float] = {}
        self.rejected = self.strangers = 0

    @property
    def port(self) -> int:
        """Where it listens."""
        return int(self._socket.getsockname()[1])

    def pilot(self, time_s: float, outputs: Mapping[str, float]) -> dict[str, float]:
        """Inputs of the newest datagrams; `rejected` counts damaged ones, `strangers` others'."""
        del time_s, outputs
        for _ in range(MOST_A_FRAME if self._listens else 0):
            try:
                data, sender = self._socket.recvfrom(MAXIMUM_DATAGRAM)
            except (BlockingIOError, ConnectionError):
                break
            try:
                # What others sent before the pilot was known may still wait.
                if self._sender not in (None, sender):
                    self.strangers += 1
                    continue
                self._held |= self._read(data)
            except (ValueError, RecursionError):
                self.rejected += 1
                continue
            if self._sender is None:
                self._sender = sender
                self._socket.connect(sender)
        return dict(self._held)

    def _read(self, data: bytes) -> dict[str, float]:
        content = json.loads(data.decode("utf-8"))
        if not isinstance(content, dict):
            raise DataError("a datagram holds no table")
        found = {}
        if not content:
            raise DataError("a datagram moves no input")
        for name, value in content.items():
            known = name in self._inputs and isinstance(value, int | float)
            if not known or isinstance(value, bool) or not abs(value) <= LARGEST_INPUT:
                raise DataError("a datagram moves what is no input", found=name)
            found[name] = float(value)
        return found

    def show(self, time_s: float, outputs: Mapping[str, float]) -> None:
        """Send the outputs; a cockpit that is not there does not stop the flight."""
        if self._send is None:
            return
        if self._style == "json":
            text = json.dumps({"time_s": time_s, **outputs})
        else:
            text = "\t".join(f"{value:.9g}" for value in outputs.values()) + "\n"
        try:
            self._cockpit.sendto(text.encode(), self._send)
        except OSError:
            self.rejected += 1

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:  # fmt: skip
        self._socket.close()
        self._cockpit.close()
