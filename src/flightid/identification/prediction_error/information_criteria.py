"""Loss and information criteria of a prediction-error fit."""

from __future__ import annotations

import math

from flightid.frozen import dataclass


@dataclass(frozen=True)
class Criteria:
    """Criteria of d coefficients fitted to N samples with loss V = (1/N) Σ e².

    Attributes
    ----------
    loss : float
        V, in the square of the output's unit.
    n_samples, n_parameters : int
        N counted samples and d coefficients.
    fpe : float or None
        Final prediction error V (1 + d/N) / (1 - d/N).
    aic, bic : float or None
        N ln V + N (ln 2π + 1) + 2d, and with d ln N for 2d. None for a loss of zero.
    aicc : float or None
        AIC + 2d (d + 1)/(N - d - 1).
    mdl : float
        Rissanen's V (1 + d ln N / N).

    Example
    -------
    >>> made = criteria(200.0, 100, 5)
    >>> round(made.fpe, 4), round(made.aicc - made.aic, 4)
    (2.2105, 0.6383)
    """

    loss: float
    n_samples: int
    n_parameters: int
    fpe: float | None
    aic: float | None
    aicc: float | None
    bic: float | None
    mdl: float

    def __str__(self) -> str:
        """All on one line."""

        def shown(value: float | None) -> str:
            return "–" if value is None else f"{value:.5g}"

        return (
            f"loss {self.loss:.5g}, FPE {shown(self.fpe)}, AIC {shown(self.aic)}, "
            f"AICc {shown(self.aicc)}, BIC {shown(self.bic)}, MDL {self.mdl:.5g}; "
            f"N = {self.n_samples}, d = {self.n_parameters}"
        )

    def to_dict(self) -> dict[str, float | int | None]:
        """Plain values."""
        return {
            "loss": self.loss,
            "n_samples": self.n_samples,
            "n_parameters": self.n_parameters,
            "fpe": self.fpe,
            "aic": self.aic,
            "aicc": self.aicc,
            "bic": self.bic,
            "mdl": self.mdl,
        }


def criteria(sum_of_squares: float, n_samples: int, n_parameters: int) -> Criteria:
    """Criteria from the sum of squared prediction errors.

    Parameters
    ----------
    sum_of_squares : float
        In the square of the output's unit.
    n_samples, n_parameters : int

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., eqs. 16.21 to 16.25; Hurvich & Tsai (1989), Regression
    and time series model selection in small samples, Biometrika 76.

    Example
    -------
    >>> criteria(0.0, 10, 2).aic is None
    True
    """
    n, d = n_samples, n_parameters
    loss = sum_of_squares / n
    fpe = loss * (1 + d / n) / (1 - d / n) if d < n else None
    aic = aicc = bic = None
    if loss > 0.0:
        twice = n * (math.log(loss) + math.log(2 * math.pi) + 1)
        aic, bic = twice + 2 * d, twice + d * math.log(n)
        aicc = aic + 2 * d * (d + 1) / (n - d - 1) if n > d + 1 else None
    return Criteria(loss, n, d, fpe, aic, aicc, bic, loss * (1 + d * math.log(n) / n))
