"""Linear systems as objects of other libraries, which hold no delays of their own."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np
import scipy
from numpy.typing import ArrayLike

from flightid.errors import ExportError, ModelError
from flightid.models.linear.realisation import Matrices

if TYPE_CHECKING:
    import control


class Rational:
    """Base of `LinearSystem`: what other libraries make of it."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    states: tuple[str, ...]
    delays_s: ArrayLike
    sample_time_s: float | None

    if TYPE_CHECKING:

        def state_space(self) -> Matrices: ...  # noqa: D102 - its own file documents it

        def sampled(self, sample_time_s: float, hold: Literal["zero", "first"]) -> Self: ...  # noqa: D102

        def with_pade(self, order: int) -> Self: ...  # noqa: D102

    def without_delays(
        self,
        *,
        pade_order: int | None = None,
        sample_time_s: float | None = None,
        hold: str = "zero",
    ) -> Self:
        """The system with its delays as states, in the way that was chosen.

        Parameters
        ----------
        pade_order : int, optional
            Approximate the delays of a continuous system.
        sample_time_s : float, optional
            Sample a continuous system exactly, delays included, s.
        hold : {"zero", "first"}
            What inputs do between those samples.

        Returns
        -------
        LinearSystem
            The delays of a sampled system become states exactly.

        Raises
        ------
        ModelError
            A continuous system has delays and no way was chosen, or both were.
        """
        if pade_order is not None and sample_time_s is not None:
            raise ModelError(
                "a delay is either approximated or sampled", found="pade_order and sample_time_s"
            )
        if sample_time_s is not None:
            return self.sampled(sample_time_s, hold)  # type: ignore[arg-type] # checked there
        delays = np.asarray(self.delays_s)
        if not np.any(delays):
            return self
        if pade_order is None and self.sample_time_s is None:
            late = zip(self.inputs, delays, strict=True)
            raise ModelError(
                "the system has delays, which a rational system cannot hold",
                found=", ".join(f"{name} {delay:g} s" for name, delay in late if delay),
                needed="pade_order to approximate them, or sample_time_s to sample them exactly",
                action="give for example pade_order=3",
            )
        return self.with_pade(1 if pade_order is None else pade_order)

    def to_control(
        self,
        *,
        pade_order: int | None = None,
        sample_time_s: float | None = None,
        hold: str = "zero",
        name: str | None = None,
    ) -> control.StateSpace:
        """The system as a state space of python-control; `flightid.to_control` says the options."""
        library = control_library()
        system = self.without_delays(pade_order=pade_order, sample_time_s=sample_time_s, hold=hold)
        require_names(system.inputs, system.outputs, system.states)
        return library.StateSpace(
            *system.state_space()[:4],
            system.sample_time_s or 0,
            inputs=list(system.inputs),
            outputs=list(system.outputs),
            states=list(system.states),
            name=name,
            remove_useless_states=False,
        )

    def to_scipy(
        self,
        *,
        pade_order: int | None = None,
        sample_time_s: float | None = None,
        hold: str = "zero",
    ) -> scipy.signal.StateSpace:
        """The system as a state space of SciPy; `flightid.to_scipy` says the options."""
        system = self.without_delays(pade_order=pade_order, sample_time_s=sample_time_s, hold=hold)
        a, b, c, d, _ = system.state_space()
        if not len(a):
            # SciPy takes no empty matrices: a state that nothing moves and nobody sees.
            a, b, c = np.zeros((1, 1)), np.zeros((1, b.shape[1])), np.zeros((c.shape[0], 1))
        step = system.sample_time_s
        return (
            scipy.signal.StateSpace(a, b, c, d)
            if step is None
            else scipy.signal.StateSpace(a, b, c, d, dt=step)
        )


def control_library() -> Any:  # noqa: ANN401 - python-control has no types
    """The module of python-control.

    Raises
    ------
    ExportError
        It is not installed.
    """
    try:
        return import_module("control")
    except ImportError as error:
        raise ExportError(
            "python-control is not installed",
            needed="the package control",
            action="pip install control",
        ) from error


def require_names(*kinds: Iterable[str]) -> None:
    """Refuse names that python-control refuses.

    Raises
    ------
    ModelError
        A name has a dot.
    """
    dotted = [name for kind in kinds for name in kind if "." in name]
    if dotted:
        raise ModelError(
            "python-control takes no dots in names",
            found=", ".join(dotted),
            needed="names without '.'",
        )
