# SPDX-License-Identifier: Apache-2.0
"""An exported library on simulated microcontrollers, in single and double precision."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from exported import said_by
from samples import sampled

from arm_sim.export import export

SUPPORT = Path(__file__).parents[2] / "support"
COMPILER, MACHINE = "arm-none-eabi-gcc", "qemu-system-arm"
BOARDS = {
    "float": ("mps2-an386", "-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16"),
    "double": ("mps2-an500", "-mcpu=cortex-m7", "-mfpu=fpv5-d16"),
}
MOST = {"float": (1700, 500), "double": (2100, 900)}
"""Instructions and bytes of stack of a computed torque; what was measured, and a little more."""

pytestmark = pytest.mark.skipif(
    not (shutil.which(COMPILER) and shutil.which(MACHINE)), reason=f"without {COMPILER}, {MACHINE}"
)


class Board:
    """A board with a floating-point unit of a type of numbers, and a library compiled for it."""

    def __init__(self, scalar: str, folder: Path) -> None:
        self.scalar, self.folder = scalar, folder
        self.machine, *self._processor = BOARDS[scalar]
        export("panda", folder / "arm", "arm", tick=False, scalar=scalar)

    def said_by(self, *sources: str | Path) -> str:
        """What a program of some sources and the library prints on the board."""
        program = self.folder / "program"
        said_by(
            COMPILER, "-O2", "-mthumb", "-mfloat-abi=hard", "-ffp-contract=off", *self._processor,
            "-specs=rdimon.specs", "-Wl,--section-start=.vectors=0", "-Wl,--undefined=vectors",
            f"-I{self.folder / 'arm'}", SUPPORT / "cortex_m_start.c", *sources,
            self.folder / "arm/arm.c", "-fstack-usage", "-lm", "-o", program,
        )  # fmt: skip
        return said_by(
            MACHINE, "-M", self.machine, "-nographic", "-monitor", "none", "-serial", "none",
            "-icount", "shift=0", "-semihosting", "-kernel", program,
        )  # fmt: skip


@pytest.mark.parametrize("scalar", sampled(BOARDS, 1))
def test_it_computes_torques_on_a_microcontroller(scalar: str, tmp_path: Path) -> None:
    """All numbers of the library's own test program are right; instructions and stack are few."""
    board = Board(scalar, tmp_path)
    assert "all results are right" in board.said_by(tmp_path / "arm/test_arm.c")
    call = "-DCALL=arm_inverse_dynamics(q, v, a, tau)"
    defined = '-DHEADER="arm.h"', f"-DSCALAR={scalar}", call
    instructions = int(board.said_by(*defined, SUPPORT / "cortex_m_count.c"))
    usage = next(tmp_path.glob("*-arm.su")).read_text()
    found = re.search(r"arm_inverse_dynamics\t(\d+)", usage)
    assert found is not None
    print(f"{board.machine}, {scalar}: {instructions} instructions, {found[1]} bytes of stack")
    most, stack = MOST[scalar]
    assert 500 < instructions < most and int(found[1]) < stack
