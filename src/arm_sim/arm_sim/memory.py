# SPDX-License-Identifier: Apache-2.0
"""Recordings that would not fit into the memory are refused before a run."""

from pathlib import Path

from arm_dynamics import InvalidInput

LARGEST_SHARE = 0.5  # of the available memory that a recording may take
_UNCHECKED = 100_000_000  # [B] for which the available memory need not be read
_CONTAINER_LIMITS = (
    Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory/memory.limit_in_bytes")
)  # fmt: skip
_RECORD = "record(path, duration, …) writes it to a file as it is made, or run it in parts"


def refuse_beyond_memory(
    ticks: int, tick_bytes: int, contents: str = "", remedy: str = _RECORD
) -> None:
    """Refuse to record more than half of the available memory holds.

    The error says ``contents``, by default a recording of so many ticks, and the remedy.
    """
    size = ticks * tick_bytes
    if size < _UNCHECKED or size <= LARGEST_SHARE * (available := _available()):
        return
    raise InvalidInput(
        f"{contents or f'a recording of {ticks} time steps'} takes {size / 1e9:.3g} GB of memory; "
        f"allowed: {LARGEST_SHARE:.0%} of the {available / 1e9:.3g} GB that are available; "
        f"{remedy}"
    )


def _available() -> float:
    """Memory in [B] that is available; infinite if the system does not report it."""
    limits = [_bytes(path, "") for path in _CONTAINER_LIMITS]
    return min(1024.0 * _bytes(Path("/proc/meminfo"), "MemAvailable:"), *limits)


def _bytes(path: Path, label: str) -> float:
    """The number after a label in a file of the system; infinite if there is none."""
    try:
        text = path.read_text(encoding="ascii")
        return float(text[text.index(label) :].removeprefix(label).split()[0])
    except (OSError, ValueError, IndexError):
        return float("inf")
