# SPDX-License-Identifier: Apache-2.0
"""Selection of the axes of a task."""

from collections.abc import Iterable

import numpy as np

from arm_dynamics.exceptions import InvalidInput, did_you_mean, known_names

# Axes of a frame: along x, y, z and about them
AXES = ("x", "y", "z", "rx", "ry", "rz")
_GROUPS = {"pose": AXES, "position": AXES[:3], "orientation": AXES[3:]}


def chosen_axes(selection: str | Iterable[str]) -> tuple[str, ...]:
    """Read a selection.

    Args:
        selection: ``pose``, ``position``, ``orientation``, or names out of x, y, z (along) and rx,
            ry, rz (about the axes), in one text or one by one.

    Returns:
        Names in the order x, y, z, rx, ry, rz.

    Raises:
        InvalidInput: If a name is unknown, given twice, or none is given.
    """
    if isinstance(selection, str) and selection in _GROUPS:
        return _GROUPS[selection]
    listed = selection.replace(",", " ").split() if isinstance(selection, str) else selection
    names = tuple(listed)
    if not names or len(set(names)) < len(names) or not set(names) <= set(AXES):
        hint = did_you_mean(selection, _GROUPS)
        allowed = f"{known_names(_GROUPS)}, or different names out of {known_names(AXES)}{hint}"
        raise InvalidInput(f"selection = {selection!r}; allowed: {allowed}")
    return tuple(axis for axis in AXES if axis in names)


def rows_of(axes: tuple[str, ...]) -> slice | np.ndarray:
    """Rows of a Jacobian for axes; a slice where they are neighbours, for it copies nothing."""
    rows = [AXES.index(axis) for axis in axes]
    if rows == list(range(rows[0], rows[-1] + 1)):
        return slice(rows[0], rows[-1] + 1)
    return np.array(rows)
