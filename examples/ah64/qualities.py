"""Bandwidth and phase delay of the bare helicopter in hover: flown model beside identified model.

Run: python examples/ah64/qualities.py [seed]

Flies and identifies the short form of the study, and reads handling qualities of both models. About
the roll axis the bare vehicle has a bandwidth; in pitch and yaw its attitude lags by more than 135°
from the slow modes on, which is why it flies with augmentation, and the growing oscillation in
pitch is worse than level 1. The values of the model are ours (README.md): no level is one of the
aircraft.
"""

import sys

from flights import truth
from identify import identified

import flightid as fid

AXES = {"roll": ("p", "lat"), "pitch": ("q", "lon"), "yaw": ("r", "ped")}
BAND_RAD_S = (0.8, 25.0)


def main(seed: str = "1") -> None:
    """Both models, then the equivalent roll mode."""
    *_, fit = identified(int(seed), short=True)
    for name, source in {"flown": truth(), "identified": fit}.items():
        found = fid.handling_qualities(source, axes=AXES, band_rad_s=BAND_RAD_S)
        print(f"{name}: {found!r}")
        print(found.summary(), end="\n\n")
    roll = fid.lower_order(fit, "lat", "p", kind="roll", band_rad_s=(1.0, 10.0))
    print(roll.summary())


if __name__ == "__main__":
    main(*sys.argv[1:])
