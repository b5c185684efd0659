# SPDX-License-Identifier: Apache-2.0
"""Functions of one number in generated code, alone and in the lanes of a vector."""

import ctypes
from collections.abc import Callable

import numpy as np
import pytest

from arm_dynamics.codegen import compiler

_LANES = 4
_LOOP = """__attribute__((visibility("default")))
void each(long long n, const double* x, double* y) {
  for (long long i = 0; i < n; i += LANES) {
    real a = 0.0;
    for (int k = 0; k < LANES; ++k) LANE(a, k) = x[i + k];
    const real found = %s(a);
    for (int k = 0; k < LANES; ++k) y[i + k] = LANE(found, k);
  }
}
"""
LANGUAGES = {
    "c": f'#include "scalar.h"\n{_LOOP}',
    "c++": f'#define LANES {_LANES}\n#include "lanes.hpp"\nextern "C" {_LOOP}',
}
"""Of one number at a time, and of one in each lane."""


def elementwise(language: str, name: str) -> Callable[[np.ndarray], np.ndarray]:
    """The function of that name, as a function of k numbers."""
    if compiler.find_compiler(language) is None:
        pytest.skip(f"no compiler of {language}")
    run = compiler.build(LANGUAGES[language] % name, language).library.each
    run.argtypes = [ctypes.c_longlong] + [ctypes.c_void_p] * 2

    def of(x: np.ndarray) -> np.ndarray:
        whole = np.resize(np.asarray(x, float), len(x) + -len(x) % _LANES)
        found = np.empty(len(whole))
        run(len(whole), whole.ctypes.data, found.ctypes.data)
        return found[: len(x)]

    return of
