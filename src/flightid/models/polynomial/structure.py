"""Structure of a linear polynomial model: which coefficients are to be found, and how."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace
from typing import Self, TypedDict

from flightid.errors import OptionError
from flightid.frozen import dataclass
from flightid.models.sampled.channels import OFFSETS
from flightid.options import Options, option

INITIAL_STATES = ("estimate", "zero")
INSTRUMENTS, REFINED = "iv4", "riv"
METHODS = ("prediction_error", INSTRUMENTS, REFINED)
BY_EXCITATION = {"ARX": INSTRUMENTS, "OE": REFINED}
"""Kinds that are fitted by way of an excitation, each by its method."""
KERNELS = ("tc", "dc")
AUTO, COMMON, SEPARATE = "auto", "common", "separate"
DENOMINATORS = (AUTO, COMMON, SEPARATE)
LARGEST = 100
"""Most coefficients of one polynomial, and the longest delay in samples, times ten."""

NativeOrders = tuple[int, list[int], int, int, list[int], list[int]]


class PolynomialOptions(TypedDict, total=False):
    """Options of `PolynomialStructure` by name."""

    initial_state: str
    backcast: bool
    method: str
    offsets: str
    denominators: str
    enforce_stability: bool
    kernel: str | None
    starts: int
    seed: int
    maximum_iterations: int


@dataclass(frozen=True)
class PolynomialStructure(Options):
    """Orders of A y = Σ (Bᵢ/Fᵢ) uᵢ(t - nkᵢ) + (C/D) e, for `identify`.

    Made by `PolynomialModel.arx`, `.armax`, `.oe`, `.bj` and `.general`.

    Attributes
    ----------
    inputs : tuple of str
    output : str
    na, nc, nd : int
        Degrees of A, C, D.
    nb, nf, nk : tuple of int
        For each input the number of coefficients of B, the degree of F and the delay in samples
        (0: a direct path).
    initial_state : str
        Before each record: ``"estimate"`` fits the values that stand for it, ``"zero"`` takes
        rest.
    backcast : bool
        Estimate what was before each record by running the noise model backwards over it, inputs
        at rest, in place of values that are fitted.
    method : str
        ``"prediction_error"``; for ARX ``"iv4"``: optimal instruments, consistent with noise of
        any colour; for OE ``"riv"``: refined instruments, the model's slopes by what the
        excitations of the records alone move of the inputs, consistent in a closed loop.
    offsets : str
        What is taken off each channel of each record: its ``"mean"``, its declared ``"trim"`` or
        nothing (``"none"``). Means are no trims where a record starts away from its working point,
        so with them a constant of each record is fitted beside the coefficients, but not with
        ``"mean_as_trim"``.
    denominators : str
        F of several inputs: ``"common"``, the same poles from all, ``"separate"``, each its own,
        or ``"auto"``, by the data where the degrees are alike: a fit by BIC, a scan by free run.
    enforce_stability : bool
        Keep the roots of A inside the unit circle too; the fit says when that moved it.
    kernel : str or None
        Regularisation of an ARX model, ``"tc"`` or ``"dc"``, its size by marginal likelihood.
    starts : int
        Number of starts of the iteration: systematic ones, then random noise models, of output
        error random denominators with the numerators that fit best.
    seed : int
        Of the random starts.
    maximum_iterations : int
    start : tuple of float
        Coefficients of the first start, in the order of `names`; empty: the systematic starts.

    Raises
    ------
    OptionError
        Orders or options outside their range.

    Example
    -------
    >>> PolynomialStructure(("u",), "y", 2, (2,), 1, 0, (0,), (1,))
    PolynomialStructure(ARMAX, 'y' from u, na 2, nb 2, nc 1, nk 1)
    """

    inputs: tuple[str, ...]
    output: str
    na: int
    nb: tuple[int, ...]
    nc: int
    nd: int
    nf: tuple[int, ...]
    nk: tuple[int, ...]
    initial_state: str = option(
        "estimate", choices=INITIAL_STATES, doc="What stands for the time before each record."
    )
    backcast: bool = option(
        False, doc="Estimate that time by running the noise model backwards over the record."
    )
    method: str = option(
        "prediction_error",
        choices=METHODS,
        doc="Prediction errors; instruments: iv4 of ARX, riv of OE in a loop that is excited.",
    )
    offsets: str = option(
        "mean", choices=OFFSETS, doc="What is taken off each channel of each record."
    )
    denominators: str = option(
        AUTO, choices=DENOMINATORS, doc="F of several inputs: one, or each its own; auto: by data."
    )
    enforce_stability: bool = option(False, doc="Keep the roots of A inside the unit circle.")
    kernel: str | None = option(None, choices=KERNELS, doc="Regularisation of an ARX model.")
    starts: int = option(
        4, minimum=1, doc="Starts of the iteration: systematic ones, then random ones."
    )
    seed: int = option(0, minimum=0, doc="Seed of the random starts.")
    maximum_iterations: int = option(200, minimum=1, doc="Most steps of each start.")
    start: tuple[float, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        self._check_orders()
        if self.start and len(self.start) != self.n_parameters:
            raise OptionError(
                "the start does not fit the orders",
                found=f"{len(self.start)} numbers",
                needed=f"{self.n_parameters}: {', '.join(self.names)}",
            )
        super().__post_init__()
        if self.denominators == COMMON and len(set(self.nf)) > 1:
            raise OptionError(
                "one denominator has one degree", found=f"nf {list(self.nf)}", needed="nf alike"
            )
        if self.backcast and self.initial_state != "estimate":
            raise OptionError(
                "backcast estimates the initial state",
                found=f"initial_state {self.initial_state!r}",
                needed="initial_state 'estimate', or no backcast",
            )
        if (self.kernel or self.method == "iv4") and not self.is_regression:
            raise OptionError(
                "instruments and kernels belong to ARX models",
                found=self.kind,
                needed="nc, nd and nf zero",
            )
        if self.method == REFINED and self.kind != "OE":
            raise OptionError(
                "refined instruments belong to output error",
                found=self.kind,
                needed="nf above zero, na, nc and nd zero",
                action="method='iv4' of ARX goes by way of an excitation too; ARMAX and BJ hold a "
                "noise model, so that a loop does not bias them where it is large enough",
            )
        if self.kernel and (self.method == "iv4" or self.enforce_stability):
            raise OptionError(
                "a kernel stands alone",
                found=f"method {self.method!r}, enforce_stability {self.enforce_stability}",
                needed="method 'prediction_error' without enforce_stability",
            )

    @property
    def past(self) -> str:
        """What stands for the time before a record: "estimate", "zero" or "backcast"."""
        return "backcast" if self.backcast else self.initial_state

    def _check_orders(self) -> None:
        channels = [self.output, *self.inputs]
        if len(set(channels)) < len(channels):
            raise OptionError("a channel is named twice", found=", ".join(channels))
        for name in ("nb", "nf", "nk"):
            if len(getattr(self, name)) != len(self.inputs):
                raise OptionError(
                    f"{name} does not fit the inputs",
                    found=len(getattr(self, name)),
                    needed=f"one for each of {len(self.inputs)} inputs",
                )
        for name in ("na", "nb", "nc", "nd", "nf", "nk"):
            value = getattr(self, name)
            limit = 10 * LARGEST if name in ("nb", "nk") else LARGEST
            for count in value if isinstance(value, tuple) else (value,):
                if not 0 <= count <= limit:
                    raise OptionError(
                        f"{name} is outside its range", found=count, needed=f"0 to {limit}"
                    )
        for name, nb, nf in zip(self.inputs, self.nb, self.nf, strict=True):
            if nb == 0 and nf > 0:
                raise OptionError(f"input {name!r} has a denominator alone", needed="nb above 0")
        if self.n_parameters == 0:
            raise OptionError("the model has no coefficients", needed="at least one order above 0")

    @property
    def kind(self) -> str:
        """ARX, ARMAX, OE, BJ or the general form, by which orders are zero."""
        filtered = any(self.nf)
        if not filtered:
            if self.nd == 0:
                return "ARMAX" if self.nc else ("ARX" if self.na else "FIR")
            return "ARARMAX" if self.nc else "ARARX"
        if self.na == 0:
            return "BJ" if self.nc or self.nd else "OE"
        return "general"

    @property
    def is_regression(self) -> bool:
        """Whether the prediction errors are linear in the coefficients."""
        return not (self.nc or self.nd or any(self.nf))

    @property
    def alternatives(self) -> tuple[Self, ...]:
        """Structures among which data choose: one denominator for all inputs, and one each.

        A `start` belongs to the second.
        """
        alike = len(self.inputs) > 1 and any(self.nf) and len(set(self.nf)) == 1
        if not alike or self.denominators != AUTO:
            return (self,)
        common = replace(self, denominators=COMMON, start=())
        return common, replace(self, denominators=SEPARATE)

    @property
    def is_common(self) -> bool:
        """Whether several inputs share one denominator."""
        return self.denominators == COMMON and len(self.inputs) > 1 and any(self.nf)

    @property
    def degrees_of_f(self) -> tuple[int, ...]:
        """Degree of each F that is fitted: one for each input, or one for all."""
        return self.nf[:1] if self.is_common else self.nf

    @property
    def counts(self) -> list[int]:
        """Coefficients of A, each B, C, D and each F that is fitted."""
        return [self.na, *self.nb, self.nc, self.nd, *self.degrees_of_f]

    @property
    def n_parameters(self) -> int:
        """Number of coefficients."""
        return sum(self.counts)

    @property
    def longest_lag(self) -> int:
        """Samples before a record on which its first values depend through A and B."""
        spans = [n + k - 1 for n, k in zip(self.nb, self.nk, strict=True) if n]
        return max([self.na, *spans])

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coefficients, by lag: ``a1``, ``b1``, or ``b1[u]`` with several inputs."""
        several = len(self.inputs) > 1

        def of_input(letter: str, first: int, count: int, name: str) -> list[str]:
            tail = f"[{name}]" if several else ""
            return [f"{letter}{lag}{tail}" for lag in range(first, first + count)]

        found = [f"a{lag}" for lag in range(1, self.na + 1)]
        for name, count, delay in zip(self.inputs, self.nb, self.nk, strict=True):
            found += of_input("b", delay, count, name)
        found += [f"c{lag}" for lag in range(1, self.nc + 1)]
        found += [f"d{lag}" for lag in range(1, self.nd + 1)]
        if self.is_common:
            return (*found, *(f"f{lag}" for lag in range(1, self.nf[0] + 1)))
        for name, count in zip(self.inputs, self.nf, strict=True):
            found += of_input("f", 1, count, name)
        return tuple(found)

    @property
    def native(self) -> NativeOrders:
        """Orders as the native half takes them."""
        return self.na, list(self.nb), self.nc, self.nd, list(self.degrees_of_f), list(self.nk)

    @property
    def nf_text(self) -> str:
        """Degrees of F in words: ``"2"``, ``"[2, 1]"``, or ``"2 common"`` to all inputs."""
        return shown(self.degrees_of_f) + " common" * self.is_common

    @property
    def orders_text(self) -> str:
        """Orders that the kind has, in words: ``"na 2, nb 2, nc 1, nk 1"``."""
        orders = {
            "na": str(self.na) if self.na else "",
            "nb": shown(self.nb) if self.inputs else "",
            "nc": str(self.nc) if self.nc else "",
            "nd": str(self.nd) if self.nd else "",
            "nf": self.nf_text if any(self.nf) else "",
            "nk": shown(self.nk) if self.inputs else "",
        }
        return ", ".join(f"{name} {value}" for name, value in orders.items() if value)

    def __repr__(self) -> str:
        """Kind and orders on one line."""
        source = f" from {', '.join(self.inputs)}" if self.inputs else ""
        return f"PolynomialStructure({self.kind}, {self.output!r}{source}, {self.orders_text})"


def shown(counts: Sequence[int]) -> str:
    """Orders of the inputs in words.

    Example
    -------
    >>> shown((2,)), shown((2, 1))
    ('2', '[2, 1]')
    """
    return str(counts[0]) if len(counts) == 1 else str(list(counts))


def per_input(value: int | Sequence[int], n_inputs: int) -> tuple[int, ...]:
    """One order for each input, from one number or a sequence.

    Example
    -------
    >>> per_input(2, 3), per_input((1, 2), 2)
    ((2, 2, 2), (1, 2))
    """
    return (value,) * n_inputs if isinstance(value, int) else tuple(value)
