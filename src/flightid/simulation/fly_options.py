"""Options of a flight in real time; see `flightid.simulation.realtime`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from flightid.errors import OptionError
from flightid.frozen import dataclass
from flightid.options import Options, option

Style = Literal["json", "flightgear"]
HIGHEST_PORT = 65535
USUAL_STEP_S = 0.01


@dataclass(frozen=True)
class FlyOptions(Options):
    """How a model is flown beside the clock, and what it hears and tells.

    Raises
    ------
    OptionError
        A gain, a limit or an address that is none.

    Example
    -------
    >>> FlyOptions(feedback={"elevator": ("q", 0.2)}).gains
    {'elevator': {'q': 0.2}}
    """

    sample_rate_hz: float | None = option(
        None, unit="Hz", above=0.0, doc="Frames a second; default: a sampled model's own, else 100."
    )
    duration_s: float = option(60.0, unit="s", above=0.0, doc="Length of the flight.")
    feedback: Mapping[str, Any] = option(
        default_factory=dict,
        doc="Stability augmentation: by input outputs and gains, elevator=q:0.2:theta:0.1.",
    )
    limits: Mapping[str, Any] = option(
        default_factory=dict, doc="Lowest and highest value by input, elevator=-0.3:0.3."
    )
    listen: int | None = option(
        None, minimum=0, maximum=HIGHEST_PORT, doc="UDP port of the pilot's inputs; 0: a free one."
    )
    host: str = option("127.0.0.1", doc="Address to listen at.")
    send: str | None = option(None, doc="HOST:PORT of a cockpit.")
    style: Style = option(
        "json", choices=("json", "flightgear"), doc="How outputs are told to the cockpit."
    )

    def step_s(self, model: object) -> float:
        """Time of a frame, s."""
        if self.sample_rate_hz is not None:
            return 1.0 / self.sample_rate_hz
        own = getattr(model, "sample_time_s", None)
        return USUAL_STEP_S if own is None else float(own)

    def __post_init__(self) -> None:
        super().__post_init__()
        # Made of the words that were given, so that what cannot be read is said at once.
        assert (self.gains, self.bounds, self.cockpit) is not None

    @property
    def gains(self) -> dict[str, dict[str, float]]:
        """Gain by input and output."""
        made: dict[str, dict[str, float]] = {}
        for name, row in self.feedback.items():
            parts = [x for pair in row.items() for x in pair] if isinstance(row, Mapping) else row
            even = isinstance(parts, list | tuple) and len(parts) % 2 == 0 and len(parts) > 0
            if not even or not all(map(_is_number, parts[1::2])):
                raise OptionError(
                    "feedback has no meaning",
                    found=f"{name}={row!r}",
                    needed="INPUT=OUTPUT:GAIN, more outputs with colons behind",
                )
            made[name] = {str(o): float(g) for o, g in zip(parts[::2], parts[1::2], strict=True)}
        return made

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest value by input."""
        made = {}
        for name, pair in self.limits.items():
            whole = isinstance(pair, list | tuple) and len(pair) == len(("low", "high"))
            if not whole or not all(map(_is_number, pair)) or not pair[0] < pair[1]:
                raise OptionError(
                    "limits have no meaning", found=f"{name}={pair!r}", needed="INPUT=LOW:HIGH"
                )
            made[name] = (float(pair[0]), float(pair[1]))
        return made

    @property
    def cockpit(self) -> tuple[str, int] | None:
        """Host and port of the cockpit."""
        if self.send is None:
            return None
        host, _, port = self.send.rpartition(":")
        if not host or not port.isdigit() or not 0 < int(port) <= HIGHEST_PORT:
            raise OptionError("send has no meaning", found=self.send, needed="HOST:PORT")
        return host, int(port)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
