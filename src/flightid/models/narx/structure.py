"""Structure of a NARX model: its lags, and the terms that `identify` chooses from."""

from __future__ import annotations

from flightid.errors import OptionError
from flightid.frozen import dataclass
from flightid.models.narx.terms import KERNELS, WIDTH_FACTORS, Lag, width_to_beta
from flightid.models.sampled.channel_order import require_inputs_first
from flightid.options import Options, option

STOPS = ("press", "sse", "err", "terms", "aic", "aicc", "bic")
CANDIDATES = ("data", "kmeans", "grid")
REGULARISATIONS = ("none", "uniform", "local")
PREDICTION, SIMULATION = "prediction", "simulation"


@dataclass(frozen=True)
class NarxStructure(Options):
    """Structure of y(t) = f(y(t-1) … y(t-n_y), u(t-d) … u(t-d-n_u+1)) for `identify`.

    Every channel is scaled to zero mean and unit deviation (N - 1) over the training records; the
    scaling stays in the fit. Constant and linear terms are always kept; the others are chosen.

    Attributes
    ----------
    inputs : tuple of str
    output : str
    output_lags, input_lags : int
        n_y, and n_u of each input.
    delay : int
        Smallest lag d of the inputs; 0 for a direct path.
    kernel : str or None
        ``"gaussian"`` exp(-d²/β²), ``"multiquadric"`` √(d²+β²), ``"inverse_multiquadric"``,
        ``"thin_plate"`` d² ln d (no width), or None for no radial functions.
    width, width_convention : float, str
        Width in deviations: ``"beta"``, ``"matlab_spread"`` (β = spread/0.8326) or ``"sigma"``
        (β = √2 σ).
    candidates : str
        Centres to choose from: ``"data"`` every training sample, or clusters of them beyond some
        4,500, ``"kmeans"`` or ``"grid"``.
    n_candidates : int
        Clusters, or levels of the grid along each regressor.
    seed : int
        Of the clusters.
    constant, linear : bool
        Whether these terms are in the model.
    degree : int
        Largest total power of the products to choose from; below 2 there are none.
    stop : str
        ``"press"`` (smallest leave-one-out error), ``"sse"`` or ``"err"`` with `goal` (of the
        scaled output), ``"aic"``, ``"aicc"``, ``"bic"``, or ``"terms"``.
    goal : float
        Sum of squared errors or error-reduction ratio that ends the selection.
    maximum_terms : int
        Most terms, constant and linear ones included.
    regularisation : str
        ``"none"``, ``"uniform"`` (one `penalty` for all chosen terms) or ``"local"``: a penalty of
        its own for each chosen term, from the evidence for it; terms without evidence go. Constant
        and linear terms are not penalised.
    penalty : float
        λ of the squared coefficient of a term's part that is orthogonal to the terms before it;
        for ``"local"`` that of the first choice.
    held_back : float
        Share of each record, at its end, that takes no part in the choice of terms: weights and
        their standard errors come from it alone, so that the errors hold in spite of the choice
        (in white noise). 0: choice and weights share all samples.
    focus : str
        What weights minimise: errors one step ahead (``"prediction"``), or of free runs
        (``"simulation"``): width, centres and number of terms then follow from free runs too, and
        the linear model is delivered where no other runs better over what was held back.
    guard : float
        Predictions are held inside the middle of the training outputs ± guard times half their
        range, and flagged.

    Raises
    ------
    OptionError
        A value outside its range.

    Example
    -------
    >>> NarxStructure(("voltage",), "theta", 4, 4, width=2.0, width_convention="sigma")
    NarxStructure('theta' from voltage, 4 + 4 lags, gaussian β = 2.828 (sigma 2), stop press)
    """

    inputs: tuple[str, ...]
    output: str
    output_lags: int = option(minimum=0, unit="samples", doc="Lags of the output.")
    input_lags: int = option(minimum=0, unit="samples", doc="Lags of each input.")
    delay: int = option(1, minimum=0, unit="samples", doc="Smallest lag of the inputs.")
    kernel: str | None = option("gaussian", choices=KERNELS, doc="Radial function.")
    width: float = option(5.0, unit="deviations", doc="Width of the radial functions.")
    width_convention: str = option("beta", choices=WIDTH_FACTORS, doc="What a width means.")
    candidates: str = option("data", choices=CANDIDATES, doc="Centres to choose from.")
    n_candidates: int = option(100, minimum=1, doc="Clusters, or levels along each regressor.")
    seed: int = option(0, minimum=0, doc="Seed of the clusters.")
    constant: bool = option(True, doc="A constant term is in the model.")
    linear: bool = option(True, doc="Linear terms are in the model.")
    degree: int = option(1, minimum=1, doc="Largest total power of the products.")
    stop: str = option("press", choices=STOPS, doc="What ends the choice of terms.")
    goal: float = option(0.0, doc="Error or error-reduction ratio that ends the choice.")
    maximum_terms: int = option(30, minimum=1, doc="Most terms.")
    regularisation: str = option("none", choices=REGULARISATIONS, doc="Penalties of weights.")
    penalty: float = option(0.0, minimum=0.0, doc="Penalty of a squared coefficient.")
    held_back: float = option(
        0.0, minimum=0.0, below=1.0, doc="Share of each record kept from the choice of terms."
    )
    focus: str = option(
        PREDICTION, choices=(PREDICTION, SIMULATION), doc="Errors that weights minimise."
    )
    guard: float = option(3.0, minimum=1.0, unit="half ranges", doc="Where predictions are held.")

    def __post_init__(self) -> None:
        require_inputs_first(self.inputs, self.output)
        object.__setattr__(self, "inputs", tuple(self.inputs))
        super().__post_init__()
        if not self.lags:
            raise OptionError("a NARX model has no lags", needed="output_lags or input_lags")
        if len({self.output, *self.inputs}) != 1 + len(self.inputs):
            raise OptionError("a channel is named twice", found=(self.output, *self.inputs))
        if self.stop in ("sse", "err") and not self.goal > 0:
            raise OptionError(f"stop {self.stop!r} has no goal", found=self.goal, needed="above 0")
        width_to_beta(self.width, self.width_convention)
        self._check_penalties()

    def _check_penalties(self) -> None:
        penalty, kind = self.penalty, self.regularisation
        if (kind == "uniform") is not (penalty > 0) and kind != "local":
            raise OptionError(
                "penalty and regularisation disagree",
                found=f"regularisation={kind!r}, penalty={penalty}",
                needed="a penalty above 0 for 'uniform', none for 'none'",
            )
        if self.held_back and kind != "none":
            raise OptionError(
                "penalised weights have no standard errors to hold samples back for",
                found=f"regularisation={kind!r}, held_back={self.held_back}",
                needed="one of the two",
            )
        if self.focus == SIMULATION and (self.held_back or kind != "none"):
            raise OptionError(
                "weights of free runs are neither penalised nor held back for",
                found=f"regularisation={kind!r}, held_back={self.held_back}",
                needed="focus='prediction', or neither of them",
            )

    @property
    def kind(self) -> str:
        """Its kind in a table of several."""
        return "NARX"

    @property
    def orders_text(self) -> str:
        """Its lags and delay in words."""
        return f"lags {self.output_lags} + {self.input_lags}, delay {self.delay}"

    @property
    def beta(self) -> float:
        """Width β, deviations."""
        return width_to_beta(self.width, self.width_convention)

    @property
    def lags(self) -> tuple[Lag, ...]:
        """The regressor vector: lags of the output, then of each input."""
        outputs = [Lag(self.output, lag) for lag in range(1, self.output_lags + 1)]
        span = range(self.delay, self.delay + self.input_lags)
        return (*outputs, *(Lag(name, lag) for name in self.inputs for lag in span))

    @property
    def longest_lag(self) -> int:
        """Samples before the first that can be predicted."""
        return max(lag.lag for lag in self.lags)

    def __repr__(self) -> str:
        """Structure on one line, the width in β and as it was given."""
        kernel = "no radial terms" if self.kernel is None else f"{self.kernel}"
        if self.kernel not in (None, "thin_plate"):
            kernel += f" β = {self.beta:.4g} ({self.width_convention} {self.width:.4g})"
        lags = f"{self.output_lags} + {self.input_lags} lags"
        return (
            f"NarxStructure({self.output!r} from {', '.join(self.inputs)}, {lags}, {kernel}, "
            f"stop {self.stop})"
        )
