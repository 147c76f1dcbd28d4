"""Exported C, compiled in a folder and driven sample by sample."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path

import numpy as np
import pytest

from flightid.export.c_compiler import c_compiler

WARNINGS = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror"]
needs_compiler = pytest.mark.skipif(c_compiler() is None, reason="no C compiler on this machine")


class CompiledModel:
    """A model from its header and source; `memory` is large enough for any test's struct."""

    def __init__(self, source: Path, prefix: str, n_outputs: int) -> None:
        library = source.with_suffix(".so")
        command = [c_compiler(), *WARNINGS, "-O0", "-fPIC", "-shared", "-o", library, source, "-lm"]
        subprocess.run(list(map(str, command)), check=True)
        self.library, self.prefix = ctypes.CDLL(str(library)), prefix
        self.memory = ctypes.create_string_buffer(1 << 20)
        self._output = np.zeros(n_outputs)
        assert self._call("init", self.memory) == 0

    def _call(self, name: str, *arguments: object) -> int:
        return getattr(self.library, f"{self.prefix}_{name}")(*arguments)

    def step(self, inputs: np.ndarray, function: str = "step") -> tuple[int, np.ndarray]:
        given = np.ascontiguousarray(inputs, dtype=np.float64)
        pointers = [x.ctypes.data_as(ctypes.c_void_p) for x in (given, self._output)]
        status = self._call(function, self.memory, *pointers)
        return status, self._output.copy()

    def run(self, inputs: np.ndarray) -> np.ndarray:
        columns = []
        for u in inputs.T:
            status, y = self.step(u)
            assert status == 0
            columns.append(y)
        return np.array(columns).T
