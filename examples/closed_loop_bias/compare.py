"""Closed-loop bias: the same simulated flights, estimated directly and with the excitation.

The autopilot feeds gyro noise and gusts back to its output, so output over input is not the vehicle
alone. The injected sweep does not depend on the noise: as an instrument it removes the bias.

Run: python examples/closed_loop_bias/compare.py
"""

import numpy as np

import flightid as fid
from flightid.vehicles import SidActivation, Turbulence, fly

OMEGA = np.geomspace(1.5, 12.0, 7)
SWEEP = SidActivation(10, 3.0, 0.06, 0.2, 6.0, 2.0, 60.0, 1.0, leave_after_s=70.0)
N_FLIGHTS = 8


def relative_error(seed: int, method: str) -> np.ndarray:
    flight = fly(runs=[SWEEP], turbulence=Turbulence(rate_rad_s=0.5), log_every=4, seed=seed)
    response = fid.estimate_response(
        flight.record((3.0, 72.0)),
        inputs="tau_phi",
        outputs="p",
        excitations="excitation" if method == "instrument" else None,
        omega_rad_s=OMEGA,
        window_s=12.0,
        estimator=method,
        covariance=False,
    )
    return response.response[0, 0] / flight.truth("roll").frequency_response(OMEGA) - 1


def main() -> None:
    print(f"mean error of {N_FLIGHTS} flights, percent of |H|")
    print("rad/s      " + "".join(f"{omega:8.2f}" for omega in OMEGA))
    for method in ("composite", "instrument"):
        errors = [relative_error(seed, method) for seed in range(N_FLIGHTS)]
        mean = 100 * np.abs(np.mean(errors, axis=0))
        print(f"{method:11s}" + "".join(f"{value:8.1f}" for value in mean))


if __name__ == "__main__":
    main()
