"""What the demo's log takes from its drop on the local page to downloaded gains, by mouse alone.

python -m benchmarks.app_demo
"""

from __future__ import annotations

import resource
import tempfile
import time
from pathlib import Path

from tests.reference.test_app_in_browser import opened_desk
from tests.reference.test_app_seeds_in_browser import WAITED_MS, demo_log, gains_by_mouse


def _processor_s() -> float:
    used = [resource.getrusage(of) for of in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used)


def main() -> None:
    """Server, its workers and the browser with all that it draws."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        log = demo_log(folder)
        begun, used = time.perf_counter(), _processor_s()
        with opened_desk(folder / "workspace") as desk:
            ready = time.perf_counter()
            page = desk.open().page
            page.set_default_timeout(WAITED_MS)
            gains_by_mouse(page, log, folder)
            done = time.perf_counter()
        said = f"browser and server up {ready - begun:.1f} s, log to gains {done - ready:.1f} s"
        print(f"{log.stat().st_size / 1e6:.0f} MB: {said}, processor {_processor_s() - used:.1f} s")


if __name__ == "__main__":
    main()
