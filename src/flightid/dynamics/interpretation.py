"""Black-box models in words: modes, zeros, cancellations, and what a pole may stand for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.errors import ModelError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification import Fit
from flightid.identification.prediction_error.roots import (
    POLE,
    ZERO,
    Errors,
    FittedRoot,
    fitted_roots,
)
from flightid.identification.subspace.roots import ALL, innovations_roots
from flightid.identification.uncertain_of import source_findings
from flightid.models import InnovationsModel, PolynomialModel
from flightid.models.sampled.discrete_modes import AT_ORIGIN, NO_COUNTERPART
from flightid.result import Result
from flightid.table import Cell, Column, Table
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.quantiles import interval_words, shown
from flightid.uncertainty.uneven import turned

LIGHT_DAMPING = 0.3
"""Pairs damped less show a resonance peak that stands out."""
NEAR = 0.05
"""Pole and zero closer than this share of the circle's radius nearly cancel."""
SLOW = 0.1
"""A real pole below this share of the Nyquist frequency is slow."""
INTEGRATOR = 1e-3
FAR = 5.0
"""Zeros this far out come from a small leading coefficient."""


@dataclass(frozen=True)
class InterpretedRoot:
    """A pole or zero with what it may stand for.

    Attributes
    ----------
    root : FittedRoot
        Place and errors.
    character : str
        What it may stand for, in words.
    time_constant : Estimate or None
        Of a real stable pole, s.

    Example
    -------
    >>> InterpretedRoot(FittedRoot("y/u", "zero", 1.2 + 0j, None, None, None), "non-minimum phase")
    InterpretedRoot(zero of y/u at 1.2: non-minimum phase)
    """

    root: FittedRoot
    character: str
    time_constant: Estimate | None = None

    @property
    def frequency_hz(self) -> float | None:
        """Natural frequency, Hz; None without one."""
        omega = self.root.natural_frequency
        return None if omega is None else omega.value / (2 * math.pi)

    def __repr__(self) -> str:
        """Place and character on one line."""
        return f"InterpretedRoot({repr(self.root)[11:-1]}: {self.character})"

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        tau = self.time_constant
        return {
            **self.root.to_dict(),
            "character": self.character,
            "frequency_hz": self.frequency_hz,
            "time_constant": None if tau is None else tau.to_dict(),
        }


@dataclass(frozen=True, repr=False, eq=False)
class Interpretation(Result, schema="flightid.interpretation/1"):
    """Result of `interpret`.

    Attributes
    ----------
    name : str
        The model's.
    sample_time_s : float
    transfer_functions : mapping of str to str
        By ``"output/input"``, in z.
    roots : tuple of InterpretedRoot
    findings : tuple of Finding

    Example
    -------
    >>> interpret(PolynomialModel(("u",), "y", 0.1, a=[1, -0.9], b=[[1.0]]))
    Interpretation(polynomial model: 1 pole, 0 zeros, 0 resonances)
    """

    name: str
    sample_time_s: float
    transfer_functions: dict[str, str]
    roots: tuple[InterpretedRoot, ...]
    findings: tuple[Finding, ...]

    @property
    def resonances(self) -> tuple[InterpretedRoot, ...]:
        """Lightly damped pairs of poles."""
        return tuple(item for item in self.roots if "resonance" in item.character)

    @property
    def sentences(self) -> tuple[str, ...]:
        """What the model says about the vehicle, one sentence for each root."""
        return tuple(_sentence(item) for item in self.roots)

    def summary(self, *, level: float | None = None) -> Table:
        """Table of poles and zeros with their meaning; transfer functions and findings below.

        Parameters
        ----------
        level : float, optional
            Of the intervals.
        """
        level = shown(level)
        columns = (
            Column("response"),
            Column("root"),
            Column("z real", digits=5),
            Column("z imaginary", digits=5),
            Column("frequency", "Hz"),
            Column("± frequency", "Hz", 2),
            Column("damping", digits=3),
            Column("± damping", digits=2),
            Column("time constant", "s"),
            Column("± time constant", "s", 2),
            Column("meaning"),
        )
        rows: list[tuple[Cell, ...]] = []
        for item in self.roots:
            root, tau = item.root, item.time_constant
            half = _half(root.natural_frequency, level)
            rows.append(
                (
                    root.response, root.kind, root.z.real, root.z.imag, item.frequency_hz,
                    None if half is None else half / (2 * math.pi),
                    None if root.damping is None or not root.z.imag else root.damping.value,
                    _half(root.damping, level) if root.z.imag else None,
                    None if tau is None else tau.value, _half(tau, level), item.character,
                )
            )  # fmt: skip
        notes = (
            *(f"{name} = {text}" for name, text in self.transfer_functions.items()),
            f"one line for each conjugate pair; ± is half a {interval_words(level)} interval",
            *map(str, self.findings),
        )
        return Table(repr(self), columns, tuple(rows), notes)

    def _computed(self) -> dict[str, object]:
        return {"sentences": self.sentences}

    def __repr__(self) -> str:
        """Size and number of resonances on one line."""

        def count(n: int, noun: str) -> str:
            return f"{n} {noun}{'' if n == 1 else 's'}"

        kinds = [item.root.kind for item in self.roots for _ in range(2 if item.root.z.imag else 1)]
        return (
            f"Interpretation({self.name}: {count(kinds.count(POLE), 'pole')}, "
            f"{count(kinds.count(ZERO), 'zero')}, {count(len(self.resonances), 'resonance')})"
        )


def interpret(
    source: object,
) -> Interpretation:
    """Say what a black-box model tells about the vehicle.

    Parameters
    ----------
    source : PolynomialModel, InnovationsModel or a fit of one
        A fit brings intervals.

    Returns
    -------
    Interpretation
        Transfer functions, poles and zeros with natural frequencies, dampings, time constants,
        which poles are slow and real (rigid-body motion, or lags) and which are lightly damped
        pairs (resonances), non-minimum-phase zeros, pairs that nearly cancel, and negative real
        poles, which have no real continuous counterpart.

    Raises
    ------
    ModelError
        Another kind of model.

    Reference
    ---------
    Åström & Wittenmark, *Computer-Controlled Systems*, 3rd ed., sections 2.5 and 2.8.

    Example
    -------
    >>> import numpy as np
    >>> rig = PolynomialModel(("u",), "y", 0.1, a=[1, -2.372, 1.465, 0.2673, -0.351],
    ...                       b=[[-0.0007, 0.007, 0.0001, 0.006]])
    >>> [round(item.frequency_hz, 3) for item in interpret(rig).resonances]
    [0.335]
    """
    discrete = source.model if isinstance(source, Fit) else source
    if not isinstance(discrete, PolynomialModel | InnovationsModel):
        raise ModelError(
            "only discrete black-box models are interpreted",
            found=type(discrete).__name__,
            needed="PolynomialModel, InnovationsModel or a fit of one",
            action="for a state-space model of known physics see flightid.modes",
        )
    if isinstance(source, Fit):
        roots = source.details.roots
    elif isinstance(discrete, PolynomialModel):
        roots = fitted_roots(discrete, 1)
    else:
        errors = Errors(discrete.sample_time_s, None, 1)
        roots = innovations_roots(discrete, errors, direct=True)
    step = discrete.sample_time_s
    made = tuple(InterpretedRoot(root, _character(root, step), _decay(root)) for root in roots)
    findings = (*_judge(made), *source_findings(source))
    return Interpretation(discrete.name, step, _transfers(discrete), made, findings)


def _transfers(model: PolynomialModel | InnovationsModel) -> dict[str, str]:
    if isinstance(model, PolynomialModel):
        pairs = {f"{model.output}/{u}": model.transfer(u) for u in model.inputs}
    else:
        pairs = {f"{y}/{u}": model.transfer(y, u) for y in model.outputs for u in model.inputs}
    found = {}
    for name, (above, below) in pairs.items():
        degree = max(above.size, below.size) - 1
        texts = [_polynomial(np.pad(row, (0, degree + 1 - row.size))) for row in (above, below)]
        found[name] = f"({texts[0]}) / ({texts[1]})"
    return found


def _polynomial(row: NDArray[np.float64]) -> str:
    degree = len(row) - 1
    terms = []
    for place, value in enumerate(row):
        if value == 0.0:
            continue
        power = degree - place
        word = {0: "", 1: " z"}.get(power, f" z^{power}")
        size = "" if abs(value) == 1.0 and power else f"{abs(value):.6g}"
        terms.append(f"{'-' if value < 0 else '+'} {(size + word).strip()}")
    text = " ".join(terms).removeprefix("+ ")
    return text.replace("- ", "-", 1) if text.startswith("- ") else text or "0"


def _character(root: FittedRoot, step: float) -> str:
    if root.kind == ZERO:
        return _zero(root.z)
    if root.note.startswith(NO_COUNTERPART):
        return f"{NO_COUNTERPART}: alternates from sample to sample, no motion of the vehicle"
    if root.note.startswith(AT_ORIGIN):
        return AT_ORIGIN
    return _pair(root) if root.z.imag else _real(root, step)


def _pair(root: FittedRoot) -> str:
    zeta = root.damping.value if root.damping else 0.0
    if zeta < 0.0:
        return "unstable oscillation"
    return "lightly damped pair: resonance" if zeta < LIGHT_DAMPING else "damped oscillation"


def _real(root: FittedRoot, step: float) -> str:
    if abs(root.z.real - 1.0) < INTEGRATOR:
        return "integrator: rigid-body position or heading"
    unstable = "unstable " if root.z.real > 1.0 else ""
    omega = 0.0 if root.natural_frequency is None else root.natural_frequency.value
    if omega < SLOW * math.pi / step:
        return f"{unstable}slow real pole: rigid-body motion or slow lag"
    return f"{unstable}fast real pole: actuator, sensor or filter lag"


def _zero(z: complex) -> str:
    if abs(z) <= 1.0:
        return ""
    if z.imag == 0.0 and z.real < 0.0:
        return "made by sampling (negative real, outside the circle): not non-minimum phase"
    if abs(z) > FAR:
        return "far outside the circle: a small leading coefficient, perhaps zero"
    return "non-minimum phase"


def _decay(root: FittedRoot) -> Estimate | None:
    """1/ω of a stable real pole; its interval is that of ω turned over."""
    omega = root.natural_frequency
    if root.kind == ZERO or omega is None or root.z.imag or abs(root.z) >= 1.0:
        return None
    name = f"time constant at z = {root.z.real:.4g}"
    unsigned = "the interval of the pole holds an integrator"
    return replace(turned(name, "s", 1.0, omega, unsigned), status="derived")


def _judge(items: Sequence[InterpretedRoot]) -> list[Finding]:
    found = []
    for item in items:
        root = item.root
        if root.note.startswith(NO_COUNTERPART):
            found.append(
                Finding(
                    "no-continuous-counterpart",
                    Light.AMBER,
                    f"{root.response}: the pole z = {root.z.real:.4g} is real and negative and has "
                    "no real continuous counterpart",
                    "read it as noise or delay dynamics of the sampled model, not as a motion; a "
                    "lower order may do without it",
                )
            )
        if item.character == "non-minimum phase":
            found.append(
                Finding(
                    "non-minimum-phase",
                    Light.AMBER,
                    f"{root.response}: zero z = {root.z:.4g} outside the unit circle: the answer "
                    "may start in the wrong direction",
                    "check it against the pulse response (flightid.impulse_response)",
                )
            )
    return found + _cancelling(items)


def _cancelling(items: Sequence[InterpretedRoot]) -> list[Finding]:
    poles = [item.root for item in items if item.root.kind == POLE]
    found = []
    for zero in (item.root for item in items if item.root.kind == ZERO):
        for pole in poles:
            if pole.response not in (zero.response, ALL) or abs(pole.z - zero.z) > NEAR:
                continue
            found.append(
                Finding(
                    "near-cancellation",
                    Light.AMBER,
                    f"{zero.response}: pole {pole.z:.4g} and zero {zero.z:.4g} nearly cancel",
                    "this response hardly shows the mode: judge it on another, or lower the order",
                )
            )
    return found


def _sentence(item: InterpretedRoot) -> str:
    root = item.root
    place = f"{root.z.real:.4g}" + (f" ± {root.z.imag:.4g}i" if root.z.imag else "")
    text = f"{root.response}: {root.kind} at z = {place}"
    if root.z.imag and root.damping is not None and item.frequency_hz is not None:
        text += f", {item.frequency_hz:.3g} Hz, damping {root.damping.value:.2g}"
    elif item.time_constant is not None:
        text += f", time constant {item.time_constant.value:.3g} s"
    return f"{text}; {item.character}." if item.character else f"{text}."


def _half(item: Estimate | None, level: float) -> float | None:
    return None if item is None else item.half(level)
