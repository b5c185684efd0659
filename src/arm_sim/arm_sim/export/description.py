# SPDX-License-Identifier: Apache-2.0
"""What an exported library says of itself: the first comment of its files, and its README."""

from __future__ import annotations

import math

from arm_dynamics import ArmModel, __version__
from arm_sim.export.library import Library
from arm_sim.export.tick import Tick
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
"""
_BITS = """
The results have the same bits at all levels of optimization, for all x86-64 and 64-bit ARM
processors, short of `-Ofast` and `-ffast-math`: the source itself forbids fused multiply-add, for
GCC and Clang, as `-ffp-contract=off` does for other compilers. Positions beyond a million radians,
and powers, ask libm, whose last bits may differ.

`cmake -D@NAME@_NATIVE=ON`, or the flags `-march=native -fno-math-errno -fno-trapping-math`, make
ticks up to a fifth faster and change no bit.
"""
_TICKS = """\
## Simulation

`@NAME@_sim_step` advances the arm by {dt:g} s ({method}{control}) under a command of each joint in
{units}: with drives, friction, stops, loops and contacts as the scene has them, to the same bits
as arm_sim's `Simulator`. The state, {states} numbers, is in memory of the caller:

```c
@NAME@_sim* sim = aligned_alloc(64, (@NAME@_sim_size() + 63) / 64 * 64);
int code = @NAME@_sim_init(sim, NULL, NULL); /* or positions and velocities, loops closed */
while (!code) {{ /* @NAME@_error_text(code) says why */
  @NAME@_sim_state(sim, q, v, effort);
  code = @NAME@_sim_step(sim, command);
}}
```

A copy of that memory continues to the same bits.
"""
_SERVO = """
`@NAME@_sim_servo` turns positions, velocities and efforts, NaN where there are none, into the
command with which the servos of the joints track them in the next tick.
"""
_SLOPES = """
`@NAME@_sim_linearize` gives the derivatives A and B of the state after the next tick by the state
now and by the command, those of arm_sim's `Simulator.linearize`, for ticks without events. Where a
joint sticks or breaks away, a stop or contact is met, or either comes close, and where the command
is exactly at its limit, it returns a code and sets nothing.
"""
_NO_SLOPES = """
There are no derivatives of ticks: the error of this one is controlled, and its sub-steps depend on
the state. Export a scene with a method of fixed steps for them.
"""
_LICENCE = """\
## Licence

The code is under the Apache License 2.0 (https://www.apache.org/licenses/LICENSE-2.0). The robot
description `@URDF@`, from whose numbers it was made, has a licence of its own.
"""


def about(name: str, model: ArmModel) -> str:
    """The first comment of the library's files."""
    tools = ", ".join(f"{name} {v}" for name, v in versions().items() if name != "machine")
    return (
        f"{name}: the dynamics of robot '{model.pin.name}', made by arm_sim {__version__}\n"
        f"({tools}).\nSPDX-License-Identifier: Apache-2.0"
    )


def readme(library: Library) -> str:
    """``README.md`` of a library."""
    model, tick = library.model, library.tick
    gravity = ", ".join(f"{g:g}" for g in model.scene.gravity)
    intro = (
        f"# {library.name}\n\nThe robot '{model.pin.name}' as a C library: {model.n} joints, "
        f"{model.total_mass:.6g} kg moving, gravity [{gravity}] m/s². "
        f"Made by arm_sim {__version__} from `{SCENE_FILE}` and `{URDF_FILE}`, which say the rest "
        "about the scene.\n"
    )
    tools = ", ".join(f"{name} {version}" for name, version in versions().items())
    parts = (
        intro,
        _joints(model),
        _functions(library),
        *([_ticks(model, tick)] if tick else []),
        _BUILD + _BITS,
        f"## Versions\n\narm_sim {__version__}, {tools}.\n",
        _LICENCE,
    )
    return "\n".join(parts).replace("@NAME@", library.name).replace("@URDF@", URDF_FILE)


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


def _functions(library: Library) -> str:
    lines = [f"| `@NAME@_{term.name}` | {term.about} |\n" for term in library.terms]
    head = "## Functions\n\nDeclared in `@NAME@.h`.\n\n| function | result |\n|---|---|\n"
    return head + "".join(lines)


def _ticks(model: ArmModel, tick: Tick) -> str:
    """About the simulation: commands, method, parameters."""
    choice = tick.simulator.choice
    units = ", ".join(dict.fromkeys(model.command_unit))
    control = "" if choice.tolerance is None else f", error controlled to {choice.tolerance:g}"
    text = _TICKS.format(
        dt=choice.dt, method=choice.method.name, control=control, units=units,
        states=tick.simulator.arm.plant.nx,
    )  # fmt: skip
    text += _SERVO if "_sim_servo" in tick.declarations else ""
    text += _SLOPES if tick.differentiable else "" if choice.tolerance is None else _NO_SLOPES
    numbers = zip(tick.parameters, tick.simulator.arm.plant.parameters.nominal, strict=False)
    rows = [f"| `{name}` | {value:.17g} |\n" for name, value in numbers]
    if not rows:
        return text
    return f"{text}\n| parameter of `@NAME@_sim_set` | in the scene |\n|---|---|\n{''.join(rows)}"
