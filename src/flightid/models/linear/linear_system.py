"""A linear system given by its matrices: what every linear model comes down to."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import field, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid import _native
from flightid.errors import (
    DataError,
    ModelError,
    OptionError,
    ShapeError,
    SingularError,
    UnknownNameError,
)
from flightid.frozen import dataclass
from flightid.models.estimated import EstimateProvenance
from flightid.models.linear.delay_states import delays_as_states, shift_registers
from flightid.models.linear.hold_equivalent import Hold, hold_equivalent
from flightid.models.linear.rational import Rational
from flightid.models.linear.realisation import Matrices
from flightid.models.parameters import Parameter
from flightid.result import TableView
from flightid.table import Column, Table

Array = NDArray[np.float64]
SCHEMA = "flightid.linear_system/1"
DEFAULT_PADE_ORDER = 3


@dataclass(frozen=True, eq=False, repr=False)
class LinearSystem(Rational, TableView):
    """A linear system given by its matrices: dx/dt = A x + B u(t − τ), y = C x + D u(t − τ).

    With a sample time it is a recursion: x[k+1] in place of dx/dt.

    Attributes
    ----------
    a, b, c, d : ndarray, shapes (n, n), (n, m), (p, n), (p, m)
        Matrices of the state space, in units that belong to the channels.
    inputs, outputs : tuple of str
        Channel names, m and p of them.
    delays_s : ndarray, shape (m,)
        Delay of each input, s; zero when left out. Whole samples of a sampled system.
    states : tuple of str
        Names; ``x1``, ``x2``, … when left out.
    sample_time_s : float or None
        s; None for continuous time.
    units : mapping of str to str
        Unit by channel and state name; what is left out is dimensionless.
    name : str
    estimated : EstimateProvenance or None
        What a fit knew of the parameters, where the model comes from its file.

    Raises
    ------
    ShapeError
        A matrix does not fit the names or the other matrices.
    DataError
        An entry that is not finite, a negative delay, a sample time that is not positive.

    Example
    -------
    >>> roll = LinearSystem([[-5.0]], [[200.0]], [[1.0]], [[0.0]], ("tau_phi",), ("p",), [0.01])
    >>> roll
    LinearSystem(1 state, inputs [tau_phi], outputs [p])
    >>> roll.state_space()[4]
    array([0.01])
    >>> abs(roll.frequency_response([5.0])[0, 0, 0]).round(3)
    np.float64(28.284)
    """

    a: ArrayLike
    b: ArrayLike
    c: ArrayLike
    d: ArrayLike
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    delays_s: ArrayLike = field(default=())
    states: tuple[str, ...] = ()
    sample_time_s: float | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    name: str = "linear system"
    estimated: EstimateProvenance | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        inputs, outputs = tuple(self.inputs), tuple(self.outputs)
        n, m, p = np.shape(self.a)[0] if np.ndim(self.a) else 0, len(inputs), len(outputs)
        delays = np.asarray(self.delays_s, dtype=np.float64)
        fields = {
            "inputs": inputs,
            "outputs": outputs,
            "states": tuple(self.states) or tuple(f"x{k + 1}" for k in range(n)),
            "units": dict(self.units),
            "a": _shaped("A", self.a, (n, n)),
            "b": _shaped("B", self.b, (n, m)),
            "c": _shaped("C", self.c, (p, n)),
            "d": _shaped("D", self.d, (p, m)),
            "delays_s": _shaped("delays_s", delays if delays.size else np.zeros(m), (m,)),
        }
        for name, value in fields.items():
            object.__setattr__(self, name, value)
        if len(self.states) != n:
            raise ShapeError("names of states do not fit A", found=len(self.states), needed=n)
        self._check_times()

    def _check_times(self) -> None:
        delays, step = np.asarray(self.delays_s), self.sample_time_s
        if np.any(delays < 0.0):
            raise DataError(
                "a delay is negative", found=f"{delays.min():g} s", needed="0 s or more"
            )
        if step is None:
            return
        if not (np.isfinite(step) and step > 0.0):
            raise DataError("the sample time is not positive", found=step, needed="seconds")
        if np.any(np.abs(delays / step - np.rint(delays / step)) > 1e-6):
            raise DataError(
                "a sampled system has a delay of part of a sample",
                found=f"{delays.tolist()} s at T = {step:g} s",
                needed="whole samples",
                action="sample the continuous system with its delay: `sampled` makes states of it",
            )

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """None: its entries are numbers without names."""
        return {}

    def with_values(self, values: Mapping[str, float]) -> Self:
        """Copy with other values of some parameters, of which it has none.

        Raises
        ------
        UnknownNameError
            There is no such one.
        """
        for name in values:
            raise UnknownNameError("a linear system has no parameters", found=repr(name))
        return self

    def linear_system(self) -> LinearSystem:
        """Itself."""
        return self

    @property
    def order(self) -> int:
        """Number of states n."""
        return len(self.states)

    @property
    def is_discrete(self) -> bool:
        """Whether it is a recursion over samples."""
        return self.sample_time_s is not None

    def state_space(self) -> Matrices:
        """A (n, n), B (n, m), C (p, n), D (p, m) and the delay of each input (m,), s."""
        a, b, c, d, delays = map(np.asarray, (self.a, self.b, self.c, self.d, self.delays_s))
        return a, b, c, d, delays

    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A: rad/s, or in the z plane; shape (n,), by real part."""
        found = np.linalg.eigvals(np.asarray(self.a)).astype(np.complex128)
        return np.asarray(found[np.lexsort((found.imag, found.real))], dtype=np.complex128)

    @property
    def is_stable(self) -> bool:
        """All poles left of the imaginary axis, or inside the unit circle."""
        poles = self.poles()
        return bool(np.all(np.abs(poles) < 1.0 if self.is_discrete else poles.real < 0.0))

    def frequency_response(self, omega_rad_s: ArrayLike) -> NDArray[np.complex128]:
        """H(jω), delays exact; of a sampled system H(e^(jωT)).

        Parameters
        ----------
        omega_rad_s : array_like, shape (n_f,)
            rad/s.

        Returns
        -------
        ndarray of complex, shape (p, m, n_f)

        Raises
        ------
        DataError
            A frequency is a pole of the system, for example an integrator at ω = 0.
        """
        a, b, c, d, delays = self.state_space()
        omega = np.atleast_1d(np.asarray(omega_rad_s, dtype=np.float64))
        step = self.sample_time_s
        points = np.asarray(
            1j * omega if step is None else np.exp(1j * omega * step), dtype=np.complex128
        )
        try:
            found = _native.linear_response(a, b, c, d, points)
        except SingularError as error:
            raise DataError(
                "the system has no finite response at these frequencies",
                found=f"{omega.min():g} to {omega.max():g} rad/s",
                needed="frequencies that are not poles of the system",
            ) from error
        if not delays.any():
            return found
        return np.asarray(found * np.exp(-1j * np.multiply.outer(delays, omega)))

    def sampled(self, sample_time_s: float, hold: Hold = "zero") -> LinearSystem:
        """The recursion that gives the exact samples for held inputs; delays become states.

        Parameters
        ----------
        sample_time_s : float
            T, s.
        hold : {"zero", "first"}
            Inputs are steps or straight lines between samples.

        Returns
        -------
        LinearSystem
            With the system's states first (with ``"first"`` and a delay below a sample less what
            the next sample adds), then past samples of delayed inputs.

        Raises
        ------
        ModelError
            The system is sampled already.
        OptionError
            An unknown hold, or a sample time that is not positive.

        Reference
        ---------
        Franklin, Powell & Workman, *Digital Control of Dynamic Systems*, 3rd ed., sections 4.3.3
        and 6.3.

        Example
        -------
        >>> lag = LinearSystem([[-5.0]], [[5.0]], [[1.0]], [[0.0]], ("u",), ("y",), [0.15])
        >>> lag.sampled(0.1)
        LinearSystem(3 states, inputs [u], outputs [y], T 0.1 s)
        """
        if self.is_discrete:
            raise ModelError("the system is sampled already", found=f"T = {self.sample_time_s:g} s")
        if hold not in ("zero", "first"):
            raise OptionError("hold is not known", found=hold, needed="'zero' or 'first'")
        if not (np.isfinite(sample_time_s) and sample_time_s > 0.0):
            raise OptionError("the sample time is not positive", found=sample_time_s)
        a, b, c, d = hold_equivalent(self.state_space(), sample_time_s, hold)
        past = tuple(f"past{k + 1}" for k in range(len(a) - self.order))
        return replace(
            self,
            a=a,
            b=b,
            c=c,
            d=d,
            delays_s=(),
            states=(*self.states, *past),
            sample_time_s=sample_time_s,
        )

    def with_pade(self, order: int = DEFAULT_PADE_ORDER) -> LinearSystem:
        """The system with its delays approximated by states; of a sampled one exactly.

        Parameters
        ----------
        order : int
            Of the diagonal approximation; its phase is right to about 1° up to ωτ = 2.5 for order 2
            and ωτ = 4.5 for order 3.

        Raises
        ------
        OptionError
            An order below one.
        """
        if order < 1:
            raise OptionError("the order of a Padé approximation", found=order, needed="1 or more")
        a, b, c, d, delays = self.state_space()
        if not np.any(delays):
            return self
        step = self.sample_time_s
        if step is None:
            found = delays_as_states((a, b, c, d, delays), order)
        else:
            found = shift_registers((a, b, c, d), np.rint(delays / step).astype(int))
        late = tuple(f"delay{k + 1}" for k in range(len(found[0]) - self.order))
        a, b, c, d = found
        return replace(self, a=a, b=b, c=c, d=d, delays_s=(), states=(*self.states, *late))

    def select(
        self, *, inputs: Iterable[str] | None = None, outputs: Iterable[str] | None = None
    ) -> Self:
        """The system with some outputs and inputs, in this order, and all states.

        Raises
        ------
        UnknownNameError
            There is no such channel.
        """
        rows = _places("output", self.outputs if outputs is None else outputs, self.outputs)
        columns = _places("input", self.inputs if inputs is None else inputs, self.inputs)
        _, b, c, d, delays = self.state_space()
        return replace(
            self,
            b=b[:, columns],
            c=c[rows],
            d=d[np.ix_(rows, columns)],
            delays_s=delays[columns],
            inputs=tuple(self.inputs[k] for k in columns),
            outputs=tuple(self.outputs[k] for k in rows),
        )

    def to_dict(self) -> dict[str, object]:
        """Plain values with a ``schema`` key; what is absent is left out, as TOML has no null."""
        a, b, c, d, delays = self.state_space()
        table: dict[str, object] = {
            "schema": SCHEMA,
            "kind": "linear",
            "name": self.name,
            "inputs": list(self.inputs),
            "outputs": list(self.outputs),
            "states": list(self.states),
            "a": a.tolist(),
            "b": b.tolist(),
            "c": c.tolist(),
            "d": d.tolist(),
            "delays_s": delays.tolist(),
            "units": dict(self.units),
        }
        if self.sample_time_s is not None:
            table["sample_time_s"] = self.sample_time_s
        return table

    def summary(self) -> Table:
        """Table of the poles, one line for each conjugate pair."""
        columns = (Column("pole real"), Column("pole imaginary"), Column("|pole|"))
        upper = [pole for pole in self.poles() if pole.imag >= 0.0]
        rows = tuple((float(p.real), float(p.imag), float(abs(p))) for p in upper)
        plane = "s plane, rad/s" if self.sample_time_s is None else "z plane"
        late = ", ".join(f"{delay:g} s" for delay in np.asarray(self.delays_s))
        kind = f"poles in the {plane}, one line for each conjugate pair"
        return Table(repr(self), columns, rows, (kind, f"delays of inputs: {late}"))

    def __repr__(self) -> str:
        """Size on one line."""
        states = f"{self.order} state{'' if self.order == 1 else 's'}"
        names = f"inputs [{', '.join(self.inputs)}], outputs [{', '.join(self.outputs)}]"
        step = "" if self.sample_time_s is None else f", T {self.sample_time_s:.4g} s"
        return f"LinearSystem({states}, {names}{step})"


def _shaped(name: str, values: ArrayLike, needed: tuple[int, ...]) -> Array:
    array = np.ascontiguousarray(values, dtype=np.float64)
    if array.shape != needed and not (array.size == 0 and 0 in needed):
        raise ShapeError(f"{name} does not fit the system", found=array.shape, needed=needed)
    if not np.all(np.isfinite(array)):
        raise DataError(f"{name} of a system is not finite", needed="finite numbers")
    return array.reshape(needed)


def _places(kind: str, wanted: Iterable[str], known: tuple[str, ...]) -> list[int]:
    for name in (found := list(wanted)):
        if name not in known:
            raise UnknownNameError(
                f"there is no such {kind}", found=repr(name), needed=", ".join(known)
            )
    return [known.index(name) for name in found]
