"""The matrices of a model in innovations form: poles, zeros, gains and responses."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.errors import ModelError
from flightid.frozen import dataclass
from flightid.models.estimated import EstimateProvenance
from flightid.models.linear.linear_system import LinearSystem
from flightid.models.parameters import Parameter
from flightid.models.sampled.coefficients import coefficients, replaced
from flightid.models.sampled.discrete_modes import DiscreteMode, discrete_modes

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
ABSENT = 1e-9
"""Pulses smaller than this share of the largest are rounding: the response is delayed."""


@dataclass(frozen=True, eq=False, repr=False)
class InnovationsForm:
    """Base of `InnovationsModel`, whose docstring says what its fields are."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
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
    estimated: EstimateProvenance | None = field(default=None, compare=False)

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

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """Entries of A, B, C, D and K by name, such as ``a1_2``.

        States have no meaning of their own, so entries carry no units.
        """
        found = dict(zip("abcdk", self.matrices, strict=True))
        names = [
            f"{letter}{i + 1}_{j + 1}"
            for letter, matrix in found.items()
            for i, j in np.ndindex(matrix.shape)
        ]
        values = np.concatenate([matrix.ravel() for matrix in found.values()])
        return coefficients(names, values, ("1",) * len(names))

    def with_values(self, values: Mapping[str, float]) -> Self:
        """Copy with other values of some entries.

        Raises
        ------
        UnknownNameError
            There is no such one.
        """
        shapes = [matrix.shape for matrix in self.matrices]
        cuts = np.cumsum([matrix.size for matrix in self.matrices])[:-1]
        pieces = np.split(np.array(replaced(self.parameters, values)), cuts)
        a, b, c, d, k = (row.reshape(shape) for row, shape in zip(pieces, shapes, strict=True))
        return replace(self, a=a, b=b, c=c, d=d, k=k, estimated=None)

    def linear_system(self) -> LinearSystem:
        """The response to the inputs as a recursion; the innovations are left out."""
        return LinearSystem(
            *self.matrices[:4],
            self.inputs,
            self.outputs,
            sample_time_s=self.sample_time_s,
            units=self.units,
            name=self.name,
        )


def response_zeros(model: InnovationsForm, i: int, j: int) -> Complex:
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
