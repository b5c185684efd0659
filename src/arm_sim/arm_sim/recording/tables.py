# SPDX-License-Identifier: Apache-2.0
"""A recording as a table: columns by name, for pandas and xarray where they are installed."""

from __future__ import annotations

from typing import Any

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput
from arm_sim.recording.motion import RecordedMotion

UNITS = {"position": ("rad", "m"), "velocity": ("rad/s", "m/s"), "effort": ("N m", "N")}
"""Units of revolute and of prismatic joints."""


def parts(recording: RecordedMotion) -> dict[str, Array]:
    """Position, velocity, effort, and the command if it is not an effort, shapes (k+1, n)."""
    found = {"position": recording.q, "velocity": recording.v, "effort": recording.tau}
    if not recording.of_robot and recording.plant.torques is not None:
        found["command"] = recording.command
    return found


def columns(recording: RecordedMotion) -> dict[str, Array]:
    """See ``Recording.to_dict``."""
    found = {"time": recording.time}
    for part, array in parts(recording).items():
        found |= {f"{part}.{name}": array[:, i] for i, name in enumerate(recording.joint_names)}
    return found | {f"state.{name}": recording.z[:, i] for i, name in enumerate(_laws(recording))}


def to_pandas(recording: RecordedMotion) -> Any:
    """See ``Recording.to_pandas``."""
    try:
        import pandas
    except ImportError:
        raise InvalidInput(_missing("pandas", "to_pandas")) from None
    return pandas.DataFrame(columns(recording)).set_index("time")


def to_xarray(recording: RecordedMotion) -> Any:
    """See ``Recording.to_xarray``."""
    try:
        import xarray
    except ImportError:
        raise InvalidInput(_missing("xarray", "to_xarray")) from None
    variables = {
        part: (("time", "joint"), array, {"units": " or ".join(UNITS.get(part, ()))})
        for part, array in parts(recording).items()
    }
    states = {"state": (("time", "law"), recording.z)} if recording.z.shape[1] else {}
    laws = {"law": list(_laws(recording))} if states else {}
    return xarray.Dataset(
        {**variables, **states},
        coords={
            "time": ("time", recording.time, {"units": "s"}),
            "joint": list(recording.joint_names),
            **laws,
        },
    )


def _laws(recording: RecordedMotion) -> tuple[str, ...]:
    if not recording.z.shape[1]:
        return ()
    laws = recording.plant.laws
    return laws.names if laws is not None else ()


def _missing(name: str, method: str) -> str:
    how = f"is not installed (pip install {name}); to_dict works without it"
    return f"{method} requires {name}, which {how}"
