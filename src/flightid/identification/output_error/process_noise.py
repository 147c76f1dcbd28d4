"""Whether residuals of a free run are what noise on the states makes of them.

Turbulence drives the states, and a free run does not follow: its residuals are innovations e of a
Kalman filter, seen through the model's own modes, v = [C (qI - A)^-1 K + I] e. Three accounts of v
are compared by their likelihood: white noise, autoregressive noise or drift of each output for
itself (sensors), and noise on the states with the best K, white or, where the model oscillates,
with a pole of its own as gusts have. The third has to beat the first at a
nominal false-alarm rate. Against the second it has to win by far, or outputs have to move together
at different times: sensors do not. Where the model oscillates it need not win by far: no sensor has
that colour. A light gust hides below the noise of every single output, and in the many numbers of
a gain: products of different outputs are asked for it too, each as one disturbance would make them
(`disturbed_states`). A single output whose noise has the colour of one real mode is left to
sensors: nothing tells them apart, and a covariance by that colour holds for both.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.errors import FlightidError
from flightid.evidence.gather import PROCESS_NOISE
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.output_error.disturbed_states import (
    disturbances,
    moved_together,
)
from flightid.identification.output_error.innovation_gain import (
    ORDER,
    innovations,
    log_size,
    observable,
    with_pole,
)
from flightid.identification.output_error.sensor_noise import (
    FALSE_ALARMS,
    crossed,
    is_white,
    sensor_errors,
)
from flightid.models import GreyBoxModel, StateSpaceModel
from flightid.models.sampled.recursion import spectral_radius
from flightid.models.state_space.measured_states import state_outputs

Array = NDArray[np.float64]
ROUNDING = 1e-8
"""Residuals over outputs below which there is rounding alone."""
LONGEST = 3000
"""Samples of a record that are looked at."""
MOST_GROWTH = 6.0
"""Growth exponent of a mode over the samples looked at, up to which a free run holds it."""
SAMPLES_PER_NUMBER = 10
STRONG = 10.0
"""Advantage that counts as very strong: Kass & Raftery (1995), J. American Statistical Ass. 90."""
COUPLED = 1e-4
"""Chance of so much correlation between outputs that move by themselves."""
TURBULENT = (
    "the residuals hold noise on the states, which output error does not know: "
    "method='filter_error' does"
)
"""Why there are no intervals."""
GUST_POLES = (0.8, 0.9, 0.95, 0.98)
"""Of gusts on an oscillating model, a sample: white noise on the states is a poor account of them,
and long autoregressions of a sensor may be a better one."""
UNDECIDED, SMOOTH = 40.0, 0.006
"""Advantage that sensors may have over noise on the states of a model that oscillates, and share of
the residuals' variance that its innovations leave, below which it stands all the same. Behind a
mode residuals are smooth from sample to sample; noise of a sensor of first order leaves 0.018 with
a memory of 100 samples and 0.006 with one of 300, and a long autoregression tells either."""
LARGEST = 16
"""Numbers of a gain beyond which that is not asked: many outputs tell by moving together."""
HALF = 0.5
"""Share of an output's residual variance that innovations leave, below which it is red."""


@dataclass(frozen=True)
class StateNoise:
    """What noise on the states explains of residuals.

    Attributes
    ----------
    p_value : float
        Of white residuals against noise on the states.
    advantage : float
        Over noise of each output by itself, twice the log-likelihood by Schwarz's criterion.
    together : float
        p-value of no correlation between outputs at different times.
    oscillates : bool
        Whether the model has modes that no sensor's noise has by chance.
    left : ndarray, shape (n_outputs,)
        Variance of one-step innovations over that of the residuals.
    """

    p_value: float
    advantage: float
    together: float
    oscillates: bool
    left: Array

    @property
    def is_found(self) -> bool:
        """Whether it is the better account than white noise, and than noise of each output."""
        better = self.advantage > (0.0 if self.oscillates else STRONG) or self.together < COUPLED
        return self.p_value < FALSE_ALARMS and (better or self._is_smooth)

    @property
    def _is_smooth(self) -> bool:
        """Whether the residuals are as smooth as behind a mode of the model, and may be it."""
        near = self.oscillates and self.advantage > -UNDECIDED
        return near and float(np.min(self.left)) < SMOOTH


def judge_process_noise(
    fitted: GreyBoxModel, records: Sequence[tuple[Array, Array, float]], runs: Sequence[Array]
) -> list[Finding]:
    """Say where output error was used on a record of turbulence.

    Parameters
    ----------
    fitted : TransferFunctionModel or StateSpaceModel
    records : sequence of tuple
        Inputs, outputs and sample time of each.
    runs : sequence of ndarray, shape (n_outputs, n_samples)
        Free runs with biases.
    """
    try:
        systems = [
            _system(fitted, inputs, run) for (inputs, _, _), run in zip(records, runs, strict=True)
        ]
    except (FlightidError, np.linalg.LinAlgError):
        return []
    steps = [dt for _, _, dt in records]
    residuals = [y - run for (_, y, _), run in zip(records, runs, strict=True)]
    pairs = zip(residuals, records, strict=True)
    if any(np.any(_level(each) <= ROUNDING * _level(y)) for each, (_, y, _) in pairs):
        return []
    found = state_noise(
        residuals,
        [(scipy.linalg.expm(a * dt), c) for (a, c), dt in zip(systems, steps, strict=True)],
    )
    disturbed = disturbances(fitted, systems)
    shown = moved_together(residuals, disturbed, steps, [u for u, _, _ in records])
    together = disturbed[0].ways[shown.way] if shown is not None and shown.is_found else ""
    if found is not None and found.is_found:
        worst = int(np.argmin(found.left))
        light = Light.RED if found.left[worst] < HALF else Light.AMBER
        what = (
            "residuals follow the model's own modes, as turbulence makes them, or dynamics that it "
            f"lacks: one sample ahead {np.sqrt(found.left[worst]):.2g} of the free run's error is "
            f"left in {fitted.outputs[worst]}"
        ) + (f"; most like {together}" if together else "")
    elif shown is not None and together:
        light = Light.AMBER
        what = (
            f"residuals of different outputs move together as {together} moves them, or dynamics "
            f"that the model lacks (p = {shown.chance:.1g} of sensors alone)"
        )
    else:
        return []
    return [
        Finding(
            PROCESS_NOISE,
            light,
            what,
            "use method='filter_error', which has noise on the states. A lag or delay that the "
            "model lacks looks alike: in calm air mend the model; else inputs that foretell the "
            "filter's innovations, or a fit that a lag or delay improves, tell",
        )
    ]


def _system(fitted: GreyBoxModel, inputs: Array, run: Array) -> tuple[Array, Array]:
    """A and C of the model at the middle of a record."""
    if not isinstance(fitted, StateSpaceModel) or fitted.is_linear:
        a, _, c, _, _ = fitted.state_space()
        return a, c
    states = state_outputs(fitted, inputs, run).states(run).mean(axis=1)
    values = map(float, (*states, *inputs.mean(axis=1)))
    at = dict(zip((*fitted.states, *fitted.inputs), values, strict=True))
    a, _, c, _, _ = fitted.state_space(at=at)
    return a, c


def state_noise(
    residuals: Sequence[Array], systems: Sequence[tuple[Array, Array]]
) -> StateNoise | None:
    """Compare the three accounts of residuals; None where there is too little to tell.

    Parameters
    ----------
    residuals : sequence of ndarray, shape (n_outputs, n_samples)
        Of each record; those no longer than the lags tell nothing.
    systems : sequence of tuple of ndarray
        Sampled A (n, n) and C (n_outputs, n) of each record.

    Returns
    -------
    StateNoise or None

    Assumes
    -------
    A model whose modes do not grow much over the samples looked at. Missing dynamics that the
    inputs excite look like noise on the states too.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., sec. 7.4 (innovations); Jategaonkar, *Flight Vehicle
    System Identification*, 2nd ed., sec. 5.2; Schwarz (1978), Annals of Statistics 6.
    """
    told = [k for k, each in enumerate(residuals) if each.shape[1] > ORDER]
    if not told:
        return None
    cut, systems = [residuals[k][:, :LONGEST] for k in told], [systems[k] for k in told]
    p, n = systems[0][1].shape
    n_rows = sum(each.shape[1] - ORDER for each in cut)
    if n == 0 or n_rows < SAMPLES_PER_NUMBER * p * max(ORDER, n):
        return None
    scale = np.sqrt(np.mean(np.concatenate(cut, axis=1) ** 2, axis=1))
    if not np.all(np.isfinite(scale)) or np.any(scale == 0.0):
        return None
    white = [each / scale[:, None] for each in cut]
    placed = [observable(a, c / scale[:, None]) for a, c in systems]
    lengths = [each.shape[1] for each in cut]
    if any(
        n * np.log(spectral_radius(a)) > MOST_GROWTH
        for n, (a, _) in zip(lengths, placed, strict=True)
    ):
        return None
    if is_white(white):
        return None
    sensors = sensor_errors(white)
    oscillates = any(np.any(np.abs(np.imag(np.linalg.eigvals(a))) > 0.0) for a, _ in placed)
    best = _account(white, placed, sensors, oscillates=oscillates)
    asked = oscillates and (len(placed[0][0]) + p) * p <= LARGEST
    for pole in GUST_POLES if asked else ():
        if best.is_found:
            break
        beside = [with_pole(*each, pole) for each in placed]
        gusts = _account(white, beside, sensors, oscillates=True, chosen=1)
        best = max(best, gusts, key=lambda each: each.advantage)
    return best


def _account(
    white: Sequence[Array],
    placed: Sequence[tuple[Array, Array]],
    sensors: tuple[Array, int],
    *,
    oscillates: bool,
    chosen: int = 0,
) -> StateNoise:
    """Noise on the states of one system beside white noise and that of sensors."""
    (errors, orders), (n, p) = sensors, placed[0][1].T.shape
    tails = [each[:, ORDER:] for each in white]
    n_rows, count = errors.shape[1], n * p + chosen
    ahead, size = innovations(white, placed)
    gain = n_rows * (log_size(tails) - size)
    return StateNoise(
        float(scipy.special.chdtrc(count, max(gain, 0.0))),
        float(n_rows * (log_size([errors]) - size) + np.log(n_rows) * (orders - count)),
        crossed(errors),
        oscillates,
        _variances([each[:, ORDER:] for each in ahead]) / _variances(tails),
    )


def _level(rows: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(rows**2, axis=1)))


def _variances(parts: Sequence[Array]) -> Array:
    return np.asarray(np.mean(np.concatenate(parts, axis=1) ** 2, axis=1))
