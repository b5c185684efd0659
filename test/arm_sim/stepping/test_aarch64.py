# SPDX-License-Identifier: Apache-2.0
"""64-bit ARM: all native code compiles, and rollouts have the bits of this processor."""

from __future__ import annotations

import runpy
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import models
from arm_dynamics.codegen import compiler
from arm_dynamics.codegen.compiled_scenes import Code
from arm_sim import Simulator

COMPILERS = {"c": "aarch64-linux-gnu-gcc", "c++": "aarch64-linux-gnu-g++"}
EMULATOR = "qemu-aarch64"
FLAGS = [flag for flag in compiler.FLAGS if flag not in ("-shared", "-Wl,-Bsymbolic")]
ARMS, TICKS = 3, 100
# Reads states and torques of all arms, and writes the states after all ticks.
DRIVER = """
int main(void) {
  static double x0[ARMS * NX], tau[ARMS * NU], out[ARMS * (TICKS + 1) * NX];
  const double length = DT, none = 0.0;
  signed char met[ARMS] = {0};
  if (fread(x0, 8, ARMS * NX, stdin) + fread(tau, 8, ARMS * NU, stdin) != ARMS * (NX + NU))
    return 1;
  rollout(x0, tau, NU, 0, &none, 0, &length, TICKS, 0, ARMS, out, 0, met);
  return fwrite(out, 8, ARMS * (TICKS + 1) * NX, stdout) != ARMS * (TICKS + 1) * NX;
}
"""

pytestmark = pytest.mark.skipif(
    not all(map(shutil.which, [*COMPILERS.values(), EMULATOR])),
    reason="needs cross compilers for aarch64 and qemu-user",
)


@pytest.mark.parametrize("lanes", [1, 2])
def test_the_same_bits_as_on_this_processor(
    lanes: int, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    build, sources = compiler.build, list[tuple[str, str]]()

    def recorded(source: str, language: str = "c") -> Code:
        sources.append((language, source))
        return build(source, language)

    monkeypatch.setattr(compiler, "build", recorded)
    sim = Simulator(models.boundless(models.scene("scara")))
    q, v, tau = rng.normal(size=(3, ARMS, sim.n))
    here = sim.rollout(q, v, tau, TICKS, lanes=lanes)
    program = cross_compiled(*sources[-1], dt=sim.dt, folder=tmp_path)
    given = np.hstack([q, v]).tobytes() + tau.tobytes()
    done = subprocess.run([EMULATOR, program], input=given, capture_output=True, check=True)
    np.testing.assert_array_equal(np.frombuffer(done.stdout).reshape(here.shape), here)


def test_all_native_code_compiles() -> None:
    tool = runpy.run_path(str(Path(__file__).parents[3] / "tools/compile_commands.py"))
    where = tool["places"]()

    def errors(file: Path) -> str:
        native, *options = tool["command"](file, where)
        compiler = COMPILERS["c++" if native == "c++" else "c"]
        return subprocess.run([compiler, *options, "-w"], capture_output=True, text=True).stderr

    with ThreadPoolExecutor(2) as pool:
        said = list(pool.map(errors, tool["files"]()))
    assert said and not any(said), "\n".join(said)


def cross_compiled(language: str, source: str, dt: float, folder: Path) -> Path:
    """A program for aarch64 of the suite's flags that runs ``rollout`` of generated code."""
    code, program = folder / f"driver.{language}", folder / "driver"
    defines = f"enum {{ ARMS = {ARMS}, TICKS = {TICKS} }};\n#define DT {dt!r}\n"
    code.write_text(f"#include <stdio.h>\n{source}\n{defines}{DRIVER}")
    flags = [*FLAGS, "-march=armv8-a", "-static", f"-I{compiler.NATIVE}"]
    command = [COMPILERS[language], "-x", language, *flags, "-o", program, code, "-lm"]
    subprocess.run(command, check=True)
    return program
