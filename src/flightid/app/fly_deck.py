"""One flight at a time: the loop in a thread, the hand and the page on its two sides."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path

from flightid.app.fly_journal import (
    FlightColumn,
    FlightJournal,
    drop_flight,
    finish_flight,
    flight_folder,
    new_flight_id,
)
from flightid.app.fly_loop import FlySwitches, PilotedVehicle, PilotSeat
from flightid.app.fly_schemas import (
    FlyFrame,
    FlyNews,
    FlyPose,
    FlyStart,
    FlyStick,
    FlySweep,
    FlySwitch,
)
from flightid.app.fly_text import write_flight_study
from flightid.app.fly_track import GroundTrack
from flightid.app.fly_vehicles import FlyVehicle, fly_vehicle
from flightid.errors import DataError, FlightidError, OptionError
from flightid.excitation.sweep import sweep
from flightid.simulation.realtime import Clock, EndOfFlight, SystemClock, fly_in_real_time

LONGEST_S = 900.0
UPSET_RAD = 1.3
"""Attitude at which a model about trim has long lost its meaning."""
UPSET = "no model of small departures holds there."
ANGLES = ("phi", "theta")
NAP_S = 0.05
Tell = Callable[[FlyNews], None]


class PauseClock:
    """A clock that can be stopped; who sleeps on it sleeps on.

    Parameters
    ----------
    clock : Clock, optional
        Left out: the machine's.
    """

    def __init__(self, clock: Clock | None = None) -> None:
        self._clock = clock or SystemClock()
        self._running = threading.Event()
        self._running.set()
        self._stood_s, self._since = 0.0, 0.0

    @property
    def stands(self) -> bool:
        """Whether it is stopped."""
        return not self._running.is_set()

    def now(self) -> float:
        """Seconds."""
        return (self._since if self.stands else self._clock.now()) - self._stood_s

    def sleep(self, seconds: float) -> None:
        """Wait until this clock has gone on by so much."""
        until = self.now() + seconds
        while (left := until - self.now()) > 0.0:
            if self.stands:
                self._running.wait(NAP_S)
            else:
                self._clock.sleep(min(left, NAP_S))

    def stop(self) -> None:
        """Stand still."""
        if not self.stands:
            self._since = self._clock.now()
            self._running.clear()

    def start(self) -> None:
        """Go on."""
        if self.stands:
            self._stood_s += self._clock.now() - self._since
            self._running.set()


class PilotedFlight:
    """A flight from its first frame to its record.

    Parameters
    ----------
    workspace : Path
        The flight is kept below it.
    asked : FlyStart
    tell : callable
        Takes news, in the thread of the loop.
    clock : Clock, optional
        Left out: the machine's.
    vehicle : FlyVehicle, optional
        Left out: that of the library which is asked for.
    """

    def __init__(
        self,
        workspace: Path,
        asked: FlyStart,
        tell: Tell,
        clock: Clock | None = None,
        vehicle: FlyVehicle | None = None,
    ) -> None:
        self.vehicle = vehicle or fly_vehicle(asked.vehicle)
        self.rate_hz = self.vehicle.rate_hz
        self.loop_units = {n: str(unit) for n, unit in self.vehicle.model.units.items()}
        self.switches = FlySwitches(
            asked.law and bool(self.vehicle.law), asked.gusts, dict(asked.failures)
        )
        seat = PilotSeat(asked.actuator_delay_s, asked.display_delay_s, asked.stick_rad_s)
        self.clock, self._tell = PauseClock(clock), tell
        self.loop = PilotedVehicle(
            self.vehicle, 1.0 / self.rate_hz, switches=self.switches, seat=seat, seed=asked.seed
        )
        self._track = GroundTrack(
            {name: self.loop_units[name] for name in self.loop.outputs},
            1.0 / self.rate_hz,
            speed_m_s=self.vehicle.speed_m_s,
        )
        self.id = new_flight_id()
        self.folder = flight_folder(workspace, self.id)
        self._journal = FlightJournal(
            self.folder, self._columns(),
            asked.model_dump(exclude={"do"})
            | {"title": self.vehicle.title, "moved": list(self.vehicle.reach)},
            sample_time_s=1.0 / self.rate_hz,
        )  # fmt: skip
        write_flight_study(self.folder, asked, self.vehicle)
        self._newest = self._flown = FlyStick(number=0, stick={})
        self._stick: dict[str, float] = {}
        self._ends, self._reason = False, ""
        self._late = 0
        self.over = False
        self._due: float | None = None
        self._display: deque[FlyFrame | None] = deque(
            [None] * round(seat.display_delay_s * self.rate_hz)
        )
        self._thread = threading.Thread(target=self._fly, name="flight", daemon=True)

    def begin(self) -> None:
        """Fly, beside the caller."""
        self._thread.start()

    def end(self) -> None:
        """End it and wait until it is kept."""
        self._ends = True
        self.clock.start()
        self.wait()

    def wait(self) -> None:
        """Wait until it has ended and is kept."""
        self._thread.join()

    def hold(self, stick: FlyStick) -> None:
        """The hand has moved; an older number changes nothing."""
        if stick.number >= self._newest.number:
            self._newest = stick

    def switch(self, asked: FlySwitch) -> None:
        """Switch augmentation, gusts and sensors."""
        self.switches.law = asked.law and bool(self.vehicle.law)
        self.switches.gusts = asked.gusts
        self.switches.failures = dict(asked.failures)

    def sweep(self, asked: FlySweep) -> None:
        """Begin or end a sweep.

        Raises
        ------
        FlightidError
            A sweep that cannot be made, or of an input that the vehicle has not.
        """
        if asked.input is None:
            self.loop.sweep(None)
            return
        reach = self.vehicle.reach
        if asked.input not in reach or asked.amplitude > reach[asked.input]:
            raise OptionError(
                "the sweep does not fit the stick",
                found=f"{asked.amplitude:g} on {asked.input}",
                needed=", ".join(f"{name} up to {most:g}" for name, most in reach.items()),
            )
        self.loop.sweep(
            sweep(
                band_rad_s=(asked.low_rad_s, asked.high_rad_s),
                amplitude=asked.amplitude,
                duration_s=asked.duration_s,
                sample_rate_hz=self.rate_hz,
                name=asked.input,
                unit=self.loop_units[asked.input],
                hold_cycles=1.0,
            )
        )

    def _columns(self) -> list[FlightColumn]:
        units = self.loop_units
        inputs, outputs = self.loop.inputs, self.loop.outputs
        return [
            *(FlightColumn(n, "input", units.get(n, "1")) for n in inputs),
            *(FlightColumn(n, "output", units.get(n, "1")) for n in outputs),
            *(FlightColumn(f"sweep_{n}", "excitation", units.get(n, "1")) for n in inputs),
            *(FlightColumn(f"stick_{n}", "other", units.get(n, "1")) for n in inputs),
        ]

    def _fly(self) -> None:
        try:
            fly_in_real_time(
                self.loop, self._pilot, duration_s=LONGEST_S, show=self._show, clock=self.clock
            )
        except EndOfFlight:
            pass
        except (FlightidError, OSError) as error:
            self._reason = self._reason or str(error)
        finally:
            self._keep()

    def _pilot(self, time_s: float, outputs: Mapping[str, float]) -> dict[str, float]:
        del outputs
        if self._ends:
            raise EndOfFlight
        now = self.clock.now()
        if self._due is None:
            self._due = now - time_s
        self._late += now - self._due - time_s > 1.0 / self.rate_hz
        self._flown = self._newest
        self._stick = self.vehicle.inputs(self._flown.stick)  # type: ignore[arg-type]
        return self._stick

    def _show(self, time_s: float, outputs: Mapping[str, float]) -> None:
        loop = self.loop
        self._journal.add([
            *loop.driven.values(), *outputs.values(), *loop.swept.values(),
            *(self._stick.get(name, 0.0) for name in loop.inputs),
        ])  # fmt: skip
        frame = FlyFrame.model_construct(
            time_s=time_s, number=self._flown.number, outputs=dict(outputs),
            pose=FlyPose.model_construct(**asdict(self._track.moved(outputs))),
            driven=dict(loop.driven), added=dict(loop.added), late_frames=self._late,
            sweeping=loop.sweeping, swept_s=dict(loop.swept_s),
        )  # fmt: skip
        self._display.append(frame)
        shown = self._display.popleft()
        if shown is not None:
            self._tell(FlyNews.model_construct(frame=shown))
        for name in ANGLES:
            if abs(outputs.get(name, 0.0)) > UPSET_RAD:
                self._reason = f"Upset: {name} beyond {UPSET_RAD:g} rad; {UPSET}"
                raise EndOfFlight

    def _keep(self) -> None:
        kept: str | None = None
        try:
            self._journal.close()
            finish_flight(self.folder)
            kept = self.id
        except DataError:
            with suppress(OSError):
                drop_flight(self.folder)
        except (FlightidError, OSError) as error:
            self._reason = f"{self._reason} The record could not be written: {error}".strip()
        self.over = True  # before the page hears of it: it asks for the list at once
        self._tell(FlyNews(state="ended", words=self._reason, kept=kept))


class FlightDeck:
    """The one flight of a server.

    Parameters
    ----------
    workspace : Path

    Attributes
    ----------
    own : dict of str to FlyVehicle
        Vehicles of the workspace that may be asked for, by name.
    """

    def __init__(self, workspace: Path) -> None:
        self.workspace = workspace
        self.own: dict[str, FlyVehicle] = {}
        self._pilot: object = None
        self.flight: PilotedFlight | None = None

    def enter(self, pilot: object) -> bool:
        """Whether this pilot has the seat; False while another has it."""
        if self._pilot not in (None, pilot):
            return False
        self._pilot = pilot
        return True

    def leave(self, pilot: object) -> None:
        """Free the seat; what is flown ends and is kept."""
        if self._pilot is pilot:
            self.stop()
            self._pilot = None

    def start(self, asked: FlyStart, tell: Tell) -> PilotedFlight:
        """Begin a flight; what was flown before ends and is kept."""
        self.stop()
        vehicle = self.own.get(asked.vehicle)
        self.flight = PilotedFlight(self.workspace, asked, tell, vehicle=vehicle)
        self.flight.begin()
        return self.flight

    def flown(self) -> str | None:
        """Which flight is in the air; None where the last one is kept, or fell."""
        flight = self.flight
        return None if flight is None or flight.over else flight.id

    def stop(self) -> None:
        """End what is flown."""
        if self.flight is not None:
            self.flight.end()
            self.flight = None
