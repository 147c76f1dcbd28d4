"""Linear state-space models in innovations form: x(t+1) = A x + B u + K e, y = C x + D u + e."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Self, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.errors import ModelError
from flightid.models.innovations.prediction import InnovationsPrediction, predict
from flightid.models.innovations.structure import SubspaceOptions, SubspaceStructure
from flightid.models.linear.discrete_modes import DiscreteMode, discrete_modes
from flightid.models.polynomial.display import zero_note
from flightid.record import Record
from flightid.table import Cell, Column, Table

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
SCHEMA = "flightid.innovations_model/1"
ABSENT = 1e-9
"""Pulses smaller than this share of the largest are rounding: the response is delayed."""


@dataclass(frozen=True, eq=False, repr=False)
class InnovationsModel:
    """x(t+1) = A x(t) + B u(t) + K e(t), y(t) = C x(t) + D u(t) + e(t).

    Channels are deviations from an operating point, in the channels' units; the states have no
    meaning of their own.

    Attributes
    ----------
    outputs, inputs : tuple of str
        p and m channel names.
    sample_time_s : float
        Sample time T, s.
    a, b, c, d, k : ndarray, shapes (n, n), (n, m), (p, n), (p, m), (n, p)
        D and K are zero when left out.
    noise_covariance : ndarray, shape (p, p), or None
        Of the innovations e, in the units of the outputs.
    units : mapping of str to str
        By channel; a channel left out is dimensionless.
    name : str
    operating_point : mapping of str to float
        Value of each channel about which the model holds, in its unit: where the training records
        were. A channel left out counts from zero.

    Raises
    ------
    ModelError
        Matrices that do not fit, are not finite, or a sample time that is not positive.

    Example
    -------
    >>> roll = InnovationsModel(("p",), ("aileron",), 0.1, [[0.8]], [[2.0]], [[1.0]])
    >>> roll
    InnovationsModel(1 state, p from aileron, T 0.1 s)
    >>> roll.poles()
    array([0.8+0.j])
    """

    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    sample_time_s: float
    a: ArrayLike
    b: ArrayLike
    c: ArrayLike
    d: ArrayLike | None = None
    k: ArrayLike | None = None
    noise_covariance: Array | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    name: str = "innovations model"
    operating_point: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "outputs", tuple(self.outputs))
        object.__setattr__(self, "inputs", tuple(self.inputs))
        p, m, n = len(self.outputs), len(self.inputs), np.shape(self.a)[0]
        shapes = {"a": (n, n), "b": (n, m), "c": (p, n), "d": (p, m), "k": (n, p)}
        for letter, shape in shapes.items():
            given = getattr(self, letter)
            matrix = np.zeros(shape) if given is None else np.array(given, dtype=np.float64)
            if matrix.shape != shape or not np.all(np.isfinite(matrix)):
                raise ModelError(
                    f"matrix {letter.upper()} does not fit the model or is not finite",
                    found=matrix.shape,
                    needed=f"finite numbers of shape {shape}",
                )
            matrix.flags.writeable = False
            object.__setattr__(self, letter, matrix)
        if not (math.isfinite(self.sample_time_s) and self.sample_time_s > 0):
            raise ModelError("the sample time is not positive", found=self.sample_time_s)
        if self.noise_covariance is not None and np.shape(self.noise_covariance) != (p, p):
            raise ModelError(
                "the noise covariance does not fit the outputs",
                found=np.shape(self.noise_covariance),
                needed=(p, p),
            )

    @staticmethod
    def subspace(
        outputs: str | Sequence[str],
        inputs: str | Sequence[str],
        order: int | None = None,
        **options: Unpack[SubspaceOptions],
    ) -> SubspaceStructure:
        """Structure for `flightid.identify`; `SubspaceStructure` says the options.

        Parameters
        ----------
        outputs, inputs : str or sequence of str
        order : int, optional
            Number of states; default: chosen from the singular values.
        **options
            ``method``, ``horizon``, ``direct``, …

        Returns
        -------
        SubspaceStructure
        """
        names = tuple(
            (each,) if isinstance(each, str) else tuple(each) for each in (outputs, inputs)
        )
        return SubspaceStructure(names[0], names[1], order, **options)

    @property
    def order(self) -> int:
        """Number of states n."""
        return int(np.shape(self.a)[0])

    @property
    def matrices(self) -> tuple[Array, Array, Array, Array, Array]:
        """A, B, C, D and K."""
        a, b, c, d, k = (np.asarray(each) for each in (self.a, self.b, self.c, self.d, self.k))
        return a, b, c, d, k

    def transformed(self, matrix: ArrayLike) -> Self:
        """The same model with states T x, T of shape (n, n)."""
        a, b, c, _, k = self.matrices
        to = np.asarray(matrix, dtype=np.float64)
        back = np.linalg.inv(to)
        return replace(self, a=to @ a @ back, b=to @ b, c=c @ back, k=to @ k)

    def poles(self) -> Complex:
        """Poles in the z plane, shape (n,), shared by all responses."""
        return np.asarray(np.linalg.eigvals(np.asarray(self.a)), dtype=np.complex128)

    def modes(self) -> tuple[DiscreteMode, ...]:
        """Natural frequencies and dampings, the slowest first, s = ln z / T."""
        return discrete_modes(self.poles(), self.sample_time_s)

    def zeros(self) -> dict[str, Complex]:
        """Zeros in the z plane of each response by ``"output/input"``.

        Reference
        ---------
        Kailath, *Linear Systems* (1980), section 2.1: poles of the inverse system.
        """
        return {
            f"{output}/{name}": response_zeros(self, i, j)
            for i, output in enumerate(self.outputs)
            for j, name in enumerate(self.inputs)
        }

    def transfer(self, output: str, name: str) -> tuple[Array, Array]:
        """Numerator and denominator of one response in powers of z⁻¹."""
        a, b, c, d, _ = self.matrices
        i, j = self.outputs.index(output), self.inputs.index(name)
        below = np.asarray(np.poly(a), dtype=np.float64)
        above = np.poly(a - np.outer(b[:, j], c[i])) + (d[i, j] - 1.0) * below
        return np.asarray(above, dtype=np.float64), below

    def gains(self) -> dict[str, float | None]:
        """Steady gain by ``"output/input"``; None for all with an integrator."""
        a, b, c, d, _ = self.matrices
        rest = np.eye(self.order) - a
        single = self.order > 0 and np.linalg.cond(rest) > 1e13
        steady = None if single else c @ np.linalg.solve(rest, b) + d
        return {
            f"{output}/{name}": None if steady is None else float(steady[i, j])
            for i, output in enumerate(self.outputs)
            for j, name in enumerate(self.inputs)
        }

    def frequency_response(self, omega_rad_s: ArrayLike) -> Complex:
        """Response from the inputs, shape (p, m, n_freqs), at frequencies in rad/s."""
        a, b, c, d, _ = self.matrices
        z = np.exp(1j * np.asarray(omega_rad_s, dtype=np.float64).ravel() * self.sample_time_s)
        solved = np.linalg.solve(z[:, None, None] * np.eye(self.order) - a, b.astype(complex))
        return np.asarray(np.moveaxis(c @ solved + d, 0, -1))

    def pulse_response(self, count: int) -> Array:
        """Markov parameters D, C B, C A B, …, shape (count, p, m)."""
        a, b, c, d, _ = self.matrices
        found = [d]
        for _ in range(count - 1):
            found.append(c @ b)
            b = a @ b
        return np.array(found[:count])

    def predict(
        self,
        record: Record,
        horizon: int | str = "free_run",
        *,
        initial_state: str = "estimate",
        offsets: str = "mean",
    ) -> InnovationsPrediction:
        """Predict the outputs of a record k steps ahead (1, 2, …) or in ``"free_run"``.

        Parameters
        ----------
        record : Record
            With the model's channels, units and sample time.
        horizon : int or "free_run"
        initial_state : {"estimate", "zero"}
            State at the first sample: the one that makes this prediction's errors smallest (k
            ahead: those one step ahead), or rest.
        offsets : {"mean", "trim", "none"}
            Operating point of each channel.

        Returns
        -------
        InnovationsPrediction

        Raises
        ------
        OptionError
            An unknown horizon, initial state or offset.
        DataError
            Another sample time.
        UnitError
            A channel in another unit.
        UnknownNameError
            A channel is missing.

        Reference
        ---------
        Ljung, *System Identification*, 2nd ed., eqs. 4.86 and 3.31.
        """
        return predict(self, record, horizon, initial_state=initial_state, offsets=offsets)

    def simulate(self, record: Record) -> Array:
        """Free run from rest on the inputs as they are, shape (p, n_samples), outputs' units."""
        return self.predict(record, "free_run", initial_state="zero", offsets="none").predicted

    def summary(self) -> Table:
        """Table of poles, and of the zeros of each response."""
        columns = (
            Column("response"),
            Column("root"),
            Column("z real", digits=5),
            Column("z imaginary", digits=5),
            Column("|z|", digits=5),
            Column("natural frequency", "rad/s"),
            Column("damping"),
            Column("note"),
        )
        rows: list[tuple[Cell, ...]] = []
        for mode in self.modes():
            note = "; ".join(filter(None, (mode.reason, "unstable" if abs(mode.z) > 1.0 else "")))
            shown = (mode.natural_frequency_rad_s, mode.damping, note)
            rows.append(("all", "pole", mode.z.real, mode.z.imag, abs(mode.z), *shown))
        for response, zeros in self.zeros().items():
            for zero in zeros[zeros.imag >= 0]:
                place = (float(zero.real), float(zero.imag), float(abs(zero)))
                rows.append((response, "zero", *place, None, None, zero_note(zero)))
        return Table(repr(self), columns, tuple(rows), ("one line for each conjugate pair",))

    def to_dict(self) -> dict[str, object]:
        """Plain values with a ``schema`` key, which `from_dict` takes back."""
        r = self.noise_covariance
        return {
            "schema": SCHEMA,
            "name": self.name,
            "outputs": list(self.outputs),
            "inputs": list(self.inputs),
            "sample_time_s": self.sample_time_s,
            **{x: m.tolist() for x, m in zip("abcdk", self.matrices, strict=True)},
            "noise_covariance": None if r is None else np.asarray(r).tolist(),
            "units": dict(self.units),
            "operating_point": dict(self.operating_point),
        }

    @classmethod
    def from_dict(cls, content: Mapping[str, object]) -> Self:
        """Model from the plain values of `to_dict`.

        Raises
        ------
        ModelError
            Another schema, or a key that is missing or of the wrong type.
        """
        values = dict(content)
        if values.pop("schema", None) != SCHEMA:
            raise ModelError("this is no innovations model", needed=f"schema {SCHEMA!r}")
        try:
            noise = values.pop("noise_covariance", None)
            covariance = None if noise is None else np.array(noise, dtype=np.float64)
            return cls(noise_covariance=covariance, **values)  # type: ignore[arg-type]
        except (TypeError, ValueError, IndexError) as problem:
            raise ModelError("the values do not make a model", found=str(problem)) from problem

    def __repr__(self) -> str:
        """Size, channels and sample time on one line."""
        states = f"{self.order} state{'' if self.order == 1 else 's'}"
        channels = f"{', '.join(self.outputs)} from {', '.join(self.inputs)}"
        return f"InnovationsModel({states}, {channels}, T {self.sample_time_s:.4g} s)"

    def _repr_html_(self) -> str:
        return self.summary()._repr_html_()


def response_zeros(model: InnovationsModel, i: int, j: int) -> Complex:
    """Zeros of the response of output i to input j.

    With the first pulse h = c Aʳ⁻¹ b that is not zero, they are the eigenvalues of A - b h⁻¹ c Aʳ
    on the states that c, c A, …, c Aʳ⁻¹ do not see.
    """
    a, b, c, d, _ = model.matrices
    pulses = model.pulse_response(model.order + 1)[:, i, j]
    present = np.abs(pulses) > ABSENT * np.max(np.abs(pulses), initial=0.0)
    if not np.any(present):
        return np.zeros(0, dtype=np.complex128)
    lag = int(np.argmax(present))
    if lag == 0:
        closed = a - np.outer(b[:, j], c[i]) / d[i, j]
    else:
        seen = np.array([c[i] @ np.linalg.matrix_power(a, power) for power in range(lag + 1)])
        closed = a - np.outer(b[:, j], seen[lag]) / pulses[lag]
        unseen = np.linalg.svd(seen[:lag])[2][lag:]
        closed = unseen @ closed @ unseen.T
    return np.asarray(np.linalg.eigvals(closed), dtype=np.complex128)
