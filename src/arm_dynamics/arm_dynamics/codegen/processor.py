# SPDX-License-Identifier: Apache-2.0
"""Instruction set extensions of this processor, and those that compiled code needs.

Names are those of Linux in /proc/cpuinfo. The levels x86-64-v2 and x86-64-v3 are those of the
System V ABI, AMD64 supplement, section 3.1.1.
"""

from collections.abc import Iterable
from functools import cache
from pathlib import Path

from arm_dynamics.exceptions import InvalidInput, choices

NATIVE = "native"
_V2 = frozenset(("cx16", "lahf_lm", "pni", "popcnt", "sse4_1", "sse4_2", "ssse3"))
_V3 = _V2 | {"abm", "avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "movbe"}
_LEVELS = {"x86-64-v2": _V2, "x86-64-v3": _V3}
TARGETS = (NATIVE, *_LEVELS)
# Those flags of an x86 processor whose instructions a compiler generates; the others concern
# virtual machines, mitigations and instructions that are not used here.
_GENERATED = ("abm", "apx", "avx", "bmi", "cx16", "f16c", "fma", "gfni", "lahf_lm", "movbe", "pni",
         "popcnt", "sse", "ssse3", "tbm", "xop")  # fmt: skip


@cache
def instructions() -> frozenset[str]:
    """Extensions of the instruction set that this processor has and compilers use."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return frozenset()
    flags = next((line for line in lines if line.startswith(("flags", "Features"))), ":")
    words = flags.partition(":")[2].split()
    if flags.startswith("Features"):  # of an ARM processor, which lists nothing else
        return frozenset(words)
    return frozenset(word for word in words if word.startswith(_GENERATED))


def needed(target: str) -> frozenset[str]:
    """Extensions that code for a target, ``native`` or a level such as ``x86-64-v3``, may use.

    Raises:
        InvalidInput: If the target is unknown.
    """
    if target not in TARGETS:
        raise InvalidInput(f"processor = {target!r}; allowed: {choices(target, TARGETS)}")
    return _LEVELS.get(target) or instructions()


def missing(needs: Iterable[str]) -> list[str]:
    """Extensions among ``needs`` that this processor lacks, sorted."""
    return sorted(set(needs) - instructions())
