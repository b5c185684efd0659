# SPDX-License-Identifier: Apache-2.0
"""Recordings that would not fit into the memory are refused before a run."""

from pathlib import Path

from arm_dynamics import InvalidInput

LARGEST_SHARE = 0.5  # of the available memory that a recording may take
_UNCHECKED = 100_000_000  # [B] for which the available memory need not be read
_GROUPS = Path("/sys/fs/cgroup")  # control groups of processes, such as of a container
# Folder of a control group's files, version 2 and 1, its limit, its use, and the label of the page
# cache, which the system gives back, among the statistics of its use
_FILES = (
    ("", "memory.max", "memory.current", "inactive_file"),
    ("memory", "memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
)
_RECORD = "record(path, duration, …) writes it to a file as it is made, or run it in parts"


def refuse_beyond_memory(
    ticks: int, tick_bytes: int, contents: str = "", remedy: str = _RECORD
) -> None:
    """Refuse to record more than half of the available memory holds.

    Args:
        ticks: Number of ticks.
        tick_bytes: Size of the recording of one tick in [B].
        contents: What is to be recorded, for the message; by default so many ticks.
        remedy: What to do instead, for the message.

    Raises:
        InvalidInput: If it takes more.
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
    of_system = 1024.0 * _bytes(Path("/proc/meminfo"), "MemAvailable:")
    return min(of_system, *(_left_in_group(*files) for files in _FILES))


def _left_in_group(folder: str, limit: str, use: str, cache: str) -> float:
    """Memory in [B] that the limit of a control group, such as a container's, leaves."""
    group = _GROUPS / folder
    used = _bytes(group / use, default=0.0) - _bytes(group / "memory.stat", cache, default=0.0)
    return _bytes(group / limit) - used


def _bytes(path: Path, label: str = "", default: float = float("inf")) -> float:
    """The number after a label in a file of the system; the default if there is none."""
    try:
        text = path.read_text(encoding="ascii")
        return float(text[text.index(label) :].removeprefix(label).split()[0])
    except (OSError, ValueError, IndexError):
        return default
