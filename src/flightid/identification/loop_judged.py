"""What injected excitations say of a fit in a closed loop: by way of them its noise is no input.

Where a loop is closed, residuals go with inputs by feedback alone, so that no test of the two tells
a biased fit. With what was injected they go only where the model errs by more than noise does.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flightid.conventions import Light
from flightid.errors import FlightidError
from flightid.findings import Finding
from flightid.identification.fit import Fit
from flightid.identification.innovation_tests import (
    FALSE_ALARMS,
    InnovationTests,
    innovation_tests,
)
from flightid.identification.withheld_intervals import without_intervals
from flightid.record.hold import Loop
from flightid.uncertainty.foretold import is_material

INSTRUMENT = (
    "fit the response by way of the excitation: estimate_response(..., estimator='instrument')"
)


def with_loop_judged(fit: Fit, loop: Loop | None) -> Fit:
    """The fit without intervals where an excitation in a closed loop refutes them.

    Parameters
    ----------
    fit : Fit
    loop : {"open", "closed"}, optional
        As declared; default: what the records know. Open loops are judged by their inputs.

    Returns
    -------
    Fit
        With a finding, red where the part of the outputs that is missed is large.

    Assumes
    -------
    Excitations that know nothing of noise and gusts. One in a hundred right models is refused.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., sections 13.4 and 16.6.
    """
    if fit.covariance is None or not is_excited_in_loop(fit, loop):
        return fit
    try:
        tests = excitation_tests(fit)
    except FlightidError:
        return fit
    if tests.independent is None or tests.independent >= FALSE_ALARMS:
        return fit
    light = Light.RED if is_material(tests.worth_percent) else Light.AMBER
    why = (
        "the model misses a part of the answer to what was injected "
        f"({tests.worth_percent:.2g} % of the output; p = {tests.independent:.2g} by chance), and "
        "no feedback makes that: its response is further off than intervals would say"
    )
    bare = without_intervals(fit, why)
    said = Finding("excitation-refutes", light, f"{why}; there are none", INSTRUMENT)
    return replace(bare, findings=(*bare.findings, said))


def is_excited_in_loop(fit: Fit, loop: Loop | None = None) -> bool:
    """Whether all records of a free run hold an excitation beside inputs that may be fed back."""
    if fit.details is not None or fit.responses or fit.residual_horizon != "free_run":
        return False
    known = {loop or each.measured.input_shape.loop for each in fit.records}
    counts = [len(each.measured.excitations) for each in fit.records]
    return bool(counts) and min(counts) > 0 and known != {"open"}


def excitation_tests(fit: Fit) -> InnovationTests:
    """Tests of what a free run leaves against the injected excitations.

    Raises
    ------
    FlightidError
        Records that are too short, or hold a channel that does not change.
    """
    names = fit.records[0].measured.excitations
    errors = [np.array([each.residual(name) for name in fit.costs]) for each in fit.records]
    injected = [np.array([each.measured[name] for name in names]) for each in fit.records]
    outputs = [np.array([each.measured[name] for name in fit.costs]) for each in fit.records]
    kept = [row[:, -left.shape[1] :] for row, left in zip(injected, errors, strict=True)]
    return innovation_tests(errors, kept, outputs, (0, 0))
