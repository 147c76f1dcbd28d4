"""The flight that stands in for the log of the rig: a log as ArduCopter writes it.

Run: python examples/quadrotor_grey_box/fly.py [rig.BIN] [seed]
"""

import sys
from pathlib import Path

import flights
from vehicles import truth

if __name__ == "__main__":
    target, number = [*sys.argv[1:], *("rig.BIN", "1")[len(sys.argv) - 1 :]]
    flights.read_back(flights.fly_published(truth(), int(number)), Path(target))
