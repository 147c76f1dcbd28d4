"""How many examples a property test draws: a sixth by default, all that it asks for at night."""

from __future__ import annotations

import os

from hypothesis import settings

PROFILE = os.environ.get("HYPOTHESIS_PROFILE", "steady")
FEWEST = 4


def examples(count: int, fewest: int = FEWEST) -> settings:
    """Decorator for a property that wants `count` examples in the long run."""
    drawn = count if PROFILE != "steady" else min(count, max(fewest, count // 6))
    return settings(max_examples=drawn, deadline=None)
