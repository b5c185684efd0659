# SPDX-License-Identifier: Apache-2.0
"""What an exported library says of itself: the first comment of its files, and its README."""

from __future__ import annotations

import math
from collections.abc import Sequence

from arm_dynamics import ArmModel
from arm_sim import __version__
from arm_sim.export.terms import Term
from arm_sim.recording.origin import SCENE_FILE, URDF_FILE, versions

_BUILD = """\
## Build

```
cmake -B build -S . && cmake --build build && ctest --test-dir build   # the test compares numbers
cmake --install build --prefix PREFIX                  # then, in CMake: find_package(@NAME@)
```

`@NAME@.c` needs a compiler for C11 or C++17 and libm, nothing else. In CMake, the target is
`@NAME@::@NAME@`, after `add_subdirectory` or `find_package`. Without CMake:

```
cc -O1 -ffp-contract=off -c @NAME@.c
```

The functions allocate nothing, keep nothing between calls and may run in several threads at once.
Arrays belong to the caller; results must not overlap arguments.

`-ffp-contract=off` forbids fused multiply-add, which would change last bits where the processor
has it. With that flag the results have the same bits at any level of optimization short of
`-Ofast` and `-ffast-math`.
"""
_LICENCE = """\
## Licence

The code is under the Apache License 2.0 (https://www.apache.org/licenses/LICENSE-2.0). The robot
description `@URDF@`, from whose numbers it was made, has a licence of its own.
"""


def about(name: str, model: ArmModel) -> str:
    """The first comment of the library's files."""
    made = ", ".join(f"{key} {version}" for key, version in versions().items() if key != "machine")
    return (
        f"{name}: the dynamics of robot '{model.pin.name}', made by arm_sim {__version__}\n"
        f"({made}).\nSPDX-License-Identifier: Apache-2.0"
    )


def readme(name: str, model: ArmModel, terms: Sequence[Term]) -> str:
    """``README.md`` of a library."""
    gravity = ", ".join(f"{g:g}" for g in model.scene.gravity)
    intro = (
        f"# {name}\n\nThe robot '{model.pin.name}' as a C library: {model.n} joints, "
        f"{model.total_mass:.6g} kg moving, gravity [{gravity}] m/s². "
        f"Made by arm_sim {__version__} from `{SCENE_FILE}` and `{URDF_FILE}`, which say the rest "
        "about the scene.\n"
    )
    parts = (
        intro,
        _joints(model),
        _functions(name, terms),
        _BUILD,
        _made_by(),
        _LICENCE,
    )
    return "\n".join(parts).replace("@NAME@", name).replace("@URDF@", URDF_FILE)


def _joints(model: ArmModel) -> str:
    head = (
        "## Joints\n\nVectors have one number for each joint, in this order: positions in rad or "
        "m, velocities\nand accelerations in these per s and s², torques in N m or N. Matrices "
        "are stored row by row.\n\n"
        "| | joint | type | lower | upper | velocity limit | effort limit |\n"
        "|---|---|---|---|---|---|---|\n"
    )
    limits = (
        model.position_lower, model.position_upper, model.velocity_limit, model.effort_limit,
    )  # fmt: skip
    rows = [
        f"| {i} | {name} | {model.joint_types[i]} | "
        + " | ".join(_number(values[i]) for values in limits)
        + " |\n"
        for i, name in enumerate(model.joint_names)
    ]
    return head + "".join(rows)


def _number(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else "none"


def _functions(name: str, terms: Sequence[Term]) -> str:
    lines = [f"| `{name}_{term.name}` | {term.about} |\n" for term in terms]
    head = f"## Functions\n\nDeclared in `{name}.h`.\n\n| function | result |\n|---|---|\n"
    return head + "".join(lines)


def _made_by() -> str:
    made = ", ".join(f"{name} {version}" for name, version in versions().items())
    return f"## Versions\n\narm_sim {__version__}, {made}.\n"
