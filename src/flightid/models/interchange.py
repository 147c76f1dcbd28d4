"""Linear systems and frequency responses to python-control and SciPy, and back."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from flightid.errors import ExportError, ModelError
from flightid.models.linear.linear_system import LinearSystem
from flightid.models.linear.rational import control_library, require_names
from flightid.models.model import linear_system
from flightid.responses import FrequencyResponse

if TYPE_CHECKING:
    import control


def to_control(
    source: object,
    *,
    pade_order: int | None = None,
    sample_time_s: float | None = None,
    hold: str = "zero",
    name: str | None = None,
) -> control.StateSpace | control.FrequencyResponseData:
    """A model, fit, system or measured response as an object of python-control.

    Names of inputs, outputs and states go along; python-control has no units.

    Parameters
    ----------
    source : FrequencyResponse, or what `linear_system` takes
    pade_order : int, optional
        Order of the Padé approximation that stands for the delays of a continuous system.
    sample_time_s : float, optional
        Sample a continuous system exactly, delays included, s.
    hold : {"zero", "first"}
        What inputs do between the samples.
    name : str, optional
        Of the system.

    Returns
    -------
    control.StateSpace or control.FrequencyResponseData

    Raises
    ------
    ModelError
        Delays and neither way of keeping them; a name that python-control refuses.
    ExportError
        python-control is not installed.

    Reference
    ---------
    Fuller et al., "The Python Control Systems Library", IEEE CDC 2021, pp. 4875-4881.

    Example
    -------
    >>> import flightid as fid
    >>> system = fid.to_control(fid.load_model("rate_first_order"), pade_order=2)
    >>> system.input_labels, system.nstates
    (['tau_phi'], 3)
    """
    if not isinstance(source, FrequencyResponse):
        system = linear_system(source)
        return system.to_control(
            pade_order=pade_order, sample_time_s=sample_time_s, hold=hold, name=name
        )
    require_names(source.inputs, source.outputs)
    return control_library().FrequencyResponseData(
        source.response,
        source.omega_rad_s,
        inputs=list(source.inputs),
        outputs=list(source.outputs),
        name=name,
    )


def from_control(
    system: control.StateSpace | control.TransferFunction | control.FrequencyResponseData,
    *,
    units: Mapping[str, str] | None = None,
    delays_s: Mapping[str, float] | None = None,
) -> LinearSystem | FrequencyResponse:
    """A system of python-control as a `LinearSystem`, its response data as a `FrequencyResponse`.

    Parameters
    ----------
    system : control.StateSpace, control.TransferFunction or control.FrequencyResponseData
    units : mapping of str to str, optional
        By channel, which python-control does not know.
    delays_s : mapping of str to float, optional
        Delay by input, s, where it was left out of the rational system.

    Returns
    -------
    LinearSystem or FrequencyResponse

    Raises
    ------
    ModelError
        Another object; a discrete system whose sample time is not given; a delay without input.
    ExportError
        python-control is not installed, or cannot convert several transfer functions without
        slycot.

    Reference
    ---------
    Fuller et al., "The Python Control Systems Library", IEEE CDC 2021, pp. 4875-4881.

    Example
    -------
    >>> import control
    >>> import flightid as fid
    >>> fid.from_control(control.tf([3.0], [1.0, 5.0], inputs="u", outputs="p"))
    LinearSystem(1 state, inputs [u], outputs [p])
    """
    library = control_library()
    known = (library.StateSpace, library.TransferFunction, library.FrequencyResponseData)
    if not isinstance(system, known):
        raise ModelError(
            "this is no linear system of python-control",
            found=type(system).__name__,
            needed="StateSpace, TransferFunction or FrequencyResponseData",
        )
    inputs, outputs = tuple(system.input_labels), tuple(system.output_labels)
    if isinstance(system, library.FrequencyResponseData):
        return FrequencyResponse.from_values(
            system.omega,
            np.asarray(system.frdata),
            inputs=inputs,
            outputs=outputs,
            units=units,
            estimator="python-control",
        )
    if isinstance(system, library.TransferFunction):
        system = _realised(library, system)
    if system.dt is True:
        raise ModelError(
            "a discrete system has no sample time", found="dt=True", needed="dt in seconds"
        )
    for name in delays_s or {}:
        if name not in inputs:
            raise ModelError("a delay has no input", found=name, needed=", ".join(inputs))
    return LinearSystem(
        np.asarray(system.A),
        np.asarray(system.B),
        np.asarray(system.C),
        np.asarray(system.D),
        inputs,
        outputs,
        [(delays_s or {}).get(name, 0.0) for name in inputs],
        tuple(system.state_labels),
        float(system.dt) if system.dt else None,
        units or {},
    )


def to_scipy(
    source: object,
    *,
    pade_order: int | None = None,
    sample_time_s: float | None = None,
    hold: str = "zero",
) -> scipy.signal.StateSpace:
    """A model, fit or system as a state space of SciPy (``dlti`` where it is sampled).

    Parameters
    ----------
    source : what `linear_system` takes
    pade_order, sample_time_s, hold
        As for `to_control`.

    Returns
    -------
    scipy.signal.StateSpace
        SciPy has neither names nor units.

    Raises
    ------
    ModelError
        Delays and neither way of keeping them.

    Reference
    ---------
    Virtanen et al., "SciPy 1.0", *Nature Methods* 17 (2020).

    Example
    -------
    >>> import flightid as fid
    >>> roll = fid.load_model("rate_first_order").with_values({"Lp": -5.0})
    >>> fid.to_scipy(roll, sample_time_s=0.1).dt
    0.1
    """
    system = linear_system(source)
    return system.to_scipy(pade_order=pade_order, sample_time_s=sample_time_s, hold=hold)


def from_scipy(
    system: scipy.signal.lti | scipy.signal.dlti,
    *,
    inputs: Iterable[str],
    outputs: Iterable[str],
    units: Mapping[str, str] | None = None,
) -> LinearSystem:
    """A linear system of SciPy with names.

    Parameters
    ----------
    system : scipy.signal.lti or scipy.signal.dlti
    inputs, outputs : iterable of str
        Channel names.
    units : mapping of str to str, optional
        By channel.

    Raises
    ------
    ModelError
        Another object, or a sample time that is not given.
    ShapeError
        The names do not fit.

    Reference
    ---------
    Virtanen et al., "SciPy 1.0", *Nature Methods* 17 (2020).

    Example
    -------
    >>> import scipy.signal
    >>> import flightid as fid
    >>> fid.from_scipy(scipy.signal.lti([3.0], [1.0, 5.0]), inputs=["u"], outputs=["p"])
    LinearSystem(1 state, inputs [u], outputs [p])
    """
    if not isinstance(system, scipy.signal.lti | scipy.signal.dlti):
        raise ModelError(
            "this is no linear system of SciPy", found=type(system).__name__, needed="lti or dlti"
        )
    step = system.dt if isinstance(system, scipy.signal.dlti) else None
    if step is True:
        raise ModelError(
            "a discrete system has no sample time", found="dt=True", needed="dt in seconds"
        )
    made: Any = system.to_ss()
    return LinearSystem(
        np.asarray(made.A),
        np.asarray(made.B),
        np.asarray(made.C),
        np.asarray(made.D),
        tuple(inputs),
        tuple(outputs),
        sample_time_s=None if step is None else float(step),
        units=units or {},
    )


def _realised(library: Any, system: Any) -> Any:  # noqa: ANN401 - python-control has no types
    """State space of transfer functions, with the names; several channels need slycot."""
    try:
        found = library.tf2ss(system)
    except (ImportError, library.ControlMIMONotImplemented) as error:
        raise ExportError(
            "python-control needs slycot to realise several transfer functions at once",
            found=f"{system.noutputs} outputs, {system.ninputs} inputs",
            needed="one pair, or slycot",
            action="give it as a state space",
        ) from error
    found.set_inputs(list(system.input_labels))
    found.set_outputs(list(system.output_labels))
    return found
