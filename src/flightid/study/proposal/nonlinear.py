"""NARX models of an output, where the inputs still foretell what its best linear model leaves."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.evidence.feedback import loop_seen
from flightid.frozen import dataclass
from flightid.identification import Fit
from flightid.models import NarxStructure
from flightid.models.narx.structure import SIMULATION
from flightid.record import Record
from flightid.study.proposal.order_scans import ProposedScans
from flightid.study.structures import runs_as_well
from flightid.uncertainty.foretold import NEGLIGIBLE_PERCENT
from flightid.uncertainty.residual_correlation import LEVEL
from flightid.validation import ResidualTests, residual_tests
from flightid.validation.order_scan.result import OrderTrial
from flightid.validation.residuals.correlation_result import Horizon, Kind, Loop, Verdict

Array = NDArray[np.float64]
LAGS = (2, 4, 6, 8, 10)
"""Of the output and of each input alike."""
DEGREES = (2, 3)
"""Largest powers of products: an even curvature, and one that is odd."""
MOST_PRODUCTS = 1_500_000
"""Candidate products times samples: half a second for each structure, at the most."""
ROUNDING = 1e-9
"""Of a cube: what is left of two levels, which bend nothing that is seen."""
OF_INPUTS = (Kind.INDEPENDENCE, Kind.EVEN, Kind.EVEN_SQUARED, Kind.BILINEAR)
"""Tests of what an input still tells of residuals, by itself, squared, or times them."""
DECLARE = (
    "it may be the controller's inverse that bends; declare --loop open where no output moved an "
    "input, and it is tried"
)


@dataclass(frozen=True, eq=False)
class NonlinearChoice:
    """What NARX models of an output reached beside the best linear one.

    Attributes
    ----------
    trial : OrderTrial or None
        The best NARX model; None where none runs freely.
    is_better : bool
        Whether its free runs err less than the linear model's by more than chance.
    said : str
        Why it was tried, and what came of it.
    """

    trial: OrderTrial | None
    is_better: bool
    said: str

    @property
    def error(self) -> float:
        """Of its free runs, in the output's unit."""
        return 0.0 if self.trial is None else self.trial.free_run_rms or 0.0

    @property
    def lines(self) -> list[str]:
        """Keys of the structure in a ``[[model]]``."""
        asked = None if self.trial is None else self.trial.structure
        if not isinstance(asked, NarxStructure):
            return []
        return [
            f"output_lags = {asked.output_lags}", f"input_lags = {asked.input_lags}",
            f"delay = {asked.delay}", f"degree = {asked.degree}",
            'kernel = "none"', f'focus = "{SIMULATION}"',
        ]  # fmt: skip


def nonlinear_choice(
    scans: ProposedScans,
    linear: Fit,
    best: OrderTrial,
    delay: int,
    settle_s: float,
) -> NonlinearChoice | None:
    """Try NARX models where tests of a linear fit ask for them, and hold them against it.

    Parameters
    ----------
    scans : ProposedScans
    linear : Fit
        The best linear model of an output.
    best : OrderTrial
        Its free runs, or those of the linear model that errs least.
    delay : int
        Smallest lag of the inputs.
    settle_s : float
        First stretch of a free run that no score counts, s.

    Returns
    -------
    NonlinearChoice or None
        None where nothing asks for it, or it would take minutes. None is tried in a loop that is
        closed or may be.
    """
    try:
        why = what_inputs_foretell(linear)
    except DataError:
        # Too few samples for a test.
        return None
    if why is None:
        return None
    (output,), inputs = linear.model.outputs, tuple(linear.model.inputs)
    flown = scans.flown(output, inputs)
    loop = loop_seen((flown,), inputs, (output,))
    if loop.is_closed or not loop.is_known:
        # What outputs move of the inputs foretells them as well as a bent vehicle would, and a
        # controller's inverse runs freely on its loop's data.
        unless = "" if loop.is_known else f"; {DECLARE}"
        return NonlinearChoice(None, False, f"NARX not tried ({why}): {loop}{unless}")
    n_samples = flown.n_samples
    asked = [*_structures(inputs, output, delay, n_samples)]
    if not asked:
        return None
    trials = scans.narx(asked, settle_s)
    curved = [each for each in trials if each.settled and not each.note and each.errors]
    if not curved:
        left = "none runs freely better than a linear one of its lags"
        return NonlinearChoice(None, False, f"NARX not taken ({why}): {left}")
    trial = min(curved, key=lambda each: each.free_run_rms or math.inf)
    is_better = not runs_as_well(best, trial)
    taken = "taken" if is_better else "not taken"
    beside = "more than chance makes" if is_better else "which chance may make"
    if trial.free_run_rms is not None and trial.free_run_rms >= (best.free_run_rms or 0.0):
        beside = "which is no more"
    words = f"{trial.structure.orders_text}, degree {getattr(trial.structure, 'degree', 1)}"
    said = (
        f"NARX {taken}, tried for {why}: {words} errs by {trial.free_run_rms:.3g} in free runs on "
        f"what was not fitted, the best linear model by {best.free_run_rms:.3g}: {beside}"
    )
    return NonlinearChoice(trial, is_better, said)


def what_inputs_foretell(fit: Fit) -> str | None:
    """The strongest test of residuals that an input fails beyond chance; None where none fails.

    Trifles in free run do not count; one step ahead what is missed of a slow output is small.

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> u = np.random.default_rng(0).uniform(-1.0, 1.0, 1500)
    >>> noise = 0.01 * np.random.default_rng(1).standard_normal(u.size)
    >>> def fitted(y):
    ...     record = fid.Record.from_arrays(np.arange(u.size) / 10, inputs={"u": u},
    ...                                     outputs={"y": y}, hold="zero")
    ...     return fid.identify(fid.PolynomialModel.arx("u", "y", na=1, nb=2), record)
    >>> straight, curved = np.roll(u, 1) + noise, np.roll(u + 0.5 * u**2, 1) + noise
    >>> what_inputs_foretell(fitted(straight)), what_inputs_foretell(fitted(curved))[:14]
    (None, 'u²ε: y, u of A')
    """
    worst = min(_failed(fit), key=lambda each: each[0], default=None)
    if worst is None:
        return None
    p_value, name = worst
    return f"{name} of {fit.structure.kind} {fit.structure.orders_text} fails (p = {p_value:.2g})"


def _failed(fit: Fit) -> Iterator[tuple[float, str]]:
    """Chance and name of each test that fails: those of the report, and of the inputs' cubes."""
    for tests in (residual_tests(fit), *_of_cubes(fit)):
        least = NEGLIGIBLE_PERCENT if tests.horizon is Horizon.FREE_RUN else 0.0
        counted = [
            each for each in tests.tests if each.counts and each.verdict is not Verdict.NOT_TESTABLE
        ]
        for each in counted:
            worth = each.worth_percent
            chance = each.p_value or 0.0
            if (
                each.kind in OF_INPUTS
                and each.verdict is Verdict.FAIL
                and chance * len(counted) < 1.0 - LEVEL
                and (worth is None or worth >= least)
            ):
                yield chance, each.name


def _of_cubes(fit: Fit) -> Iterator[ResidualTests]:
    """Whether cubes of the inputs, what is linear in them taken out, foretell what a fit leaves.

    A valve at its stops bends a response alike on both sides: squares of the input see nothing.
    """
    horizon = Horizon.ONE_STEP if fit.residual_horizon == 1 else Horizon.FREE_RUN
    for name in fit.model.inputs:
        cubes = [_cubed(record[name]) for record in fit.residuals]
        if any(np.ptp(cube) == 0.0 for cube in cubes):
            continue
        beside = [
            Record.from_arrays(
                record.time_s,
                inputs={f"{name}³": cube},
                outputs={output: record[output] for output in fit.model.outputs},
            )
            for record, cube in zip(fit.residuals, cubes, strict=True)
        ]
        tests = residual_tests(beside, horizon=horizon, loop=Loop.OPEN)
        linear = [each for each in tests.tests if each.kind is Kind.INDEPENDENCE]
        yield replace(tests, tests=tuple(linear))


def _cubed(row: Array) -> Array:
    """The cube about its mean without its part along the input; zero of two levels alike."""
    from_mean = row - row.mean()
    cube = from_mean**3 - np.mean(from_mean**3)
    power = float(from_mean @ from_mean)
    left = cube - from_mean * (float(from_mean @ cube) / power if power > 0.0 else 0.0)
    tiny = float(np.abs(left).max()) <= ROUNDING * float(np.abs(cube).max())
    return np.zeros_like(row) if tiny else left


def _structures(
    inputs: tuple[str, ...], output: str, delay: int, n_samples: int
) -> Iterator[NarxStructure]:
    """Those whose products can be chosen from in seconds."""
    for lags, degree in product(LAGS, DEGREES):
        asked = NarxStructure(
            *(inputs, output, lags, lags, delay), kernel=None, degree=degree, focus=SIMULATION
        )
        products = math.comb(len(asked.lags) + degree, degree)
        if products * n_samples <= MOST_PRODUCTS:
            yield asked
