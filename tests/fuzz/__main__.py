"""Many seeds in children: `python -m tests.fuzz --runs 100000 --first-seed 0 --keep FOLDER`."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

from tests.fuzz.runs import made

BATCH = 2000


def main() -> int:
    """Count ends; what broke is printed and, with `--keep`, kept as a file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="folder for files that broke a reader")
    asked = parser.parse_args()
    ends: Counter[str] = Counter()
    peak_mib, at, last = 0, asked.first_seed, asked.first_seed + asked.runs
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "seed"
        while at < last:
            count = min(BATCH, last - at)
            words = [sys.executable, "-m", "tests.fuzz.child", str(at), str(count), str(report)]
            done = subprocess.run(words, capture_output=True, text=True, check=False)
            lines = done.stdout.splitlines()
            if done.returncode == 0:
                told = json.loads(lines.pop())
                ends.update(told["ends"])
                peak_mib, at = max(peak_mib, told["peak_mib"]), at + count
            else:
                broken = int(report.read_text()) if report.exists() else at
                lines.append(f"{broken} {made(broken)[0].name} ended with code {done.returncode}")
                ends["FAULT"] += 1
                ends["before a fault"] += broken - at
                at = broken + 1
            for line in lines:
                print(line, flush=True)
                _keep(asked.keep, line)
    print(f"{asked.runs} files: {dict(ends)}, peak {peak_mib} MiB")
    return 1 if ends["FAULT"] else 0


def _keep(folder: Path | None, line: str) -> None:
    if folder is not None and (seed := line.split(maxsplit=1)[0]).isdigit():
        folder.mkdir(parents=True, exist_ok=True)
        chosen, content = made(int(seed))
        (folder / f"{chosen.name}~{seed}").write_bytes(content)


if __name__ == "__main__":
    sys.exit(main())
