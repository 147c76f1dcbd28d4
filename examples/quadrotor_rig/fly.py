"""Fly the rig and keep the log: the advised sweeps, or those of the published rig study.

Run: python examples/quadrotor_rig/fly.py flight.BIN [advised|published] [seed]
"""

import sys
from pathlib import Path

from flightid.vehicles import fly_scenario, write_ardupilot_log


def main(path: Path, scenario: str = "advised", seed: str = "0") -> None:
    flight = fly_scenario(scenario, seed=int(seed))
    write_ardupilot_log(flight, path)
    print(f"{flight} -> {path}")
    print(flight.summary())


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), *sys.argv[2:])
