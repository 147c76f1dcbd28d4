"""Seeds one after the other, inside limits of memory and time: `python -m tests.fuzz.child ...`."""

from __future__ import annotations

import json
import resource
import signal
import sys
import tempfile
from collections import Counter
from pathlib import Path

from tests.fuzz.runs import ended, made, sound

MEMORY_BYTES = 6 << 30  # of addresses: libraries reserve far more than they touch
SECONDS = 10.0  # of the processor


def main(first: int, count: int, report: Path) -> None:
    """Run seeds; the last line of the report names the one that is running."""
    sound()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    ends: Counter[str] = Counter()
    with report.open("w") as file, tempfile.TemporaryDirectory() as folder:
        for seed in range(first, first + count):
            file.seek(0)
            file.write(f"{seed:012d}\n")
            file.flush()
            signal.setitimer(signal.ITIMER_PROF, SECONDS)  # its signal ends the process
            chosen, content = made(seed)
            try:
                ends[ended(chosen, content, Path(folder))] += 1
            except Exception as error:
                ends["FAULT"] += 1
                print(f"{seed} {chosen.name} {type(error).__name__}: {error}"[:300])
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(json.dumps({"ends": ends, "peak_mib": peak >> 10}))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]))
