# SPDX-License-Identifier: Apache-2.0
"""Exceptions of the suite.

Each message states what is wrong, the value and what is allowed.
"""

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import FrozenInstanceError
from difflib import get_close_matches
from pathlib import Path

# The suite's command here: the script of its folder, or what pip has installed
ARM = "./arm" if (Path(__file__).parents[3] / "arm").is_file() else "arm"
_MANY_TURNS = 4.0 * math.pi  # [rad]
_NAME = 80  # characters of a name that are shown
_ALMOST = 0.8  # similarity of names that is more than one name in another
# What other libraries call it, by our names; those with a dot are not in the same place
ELSEWHERE = {
    "mass_matrix": "M H D inertia inertia_matrix crba",
    "coriolis_matrix": "C coriolis",
    "gravity": "G g gravload",
    "inverse": "rne rnea id idyn inverse_dynamics nle bias",
    "forward": "aba fd accel fdyn forward_dynamics",
    "pose": "fkine fk forward_kinematics T",
    "jacobian": "J jac jacob0 frame_jacobian",
    "arm_dynamics.task_space.InverseKinematics": "ik ikine inverse_kinematics",
    "kinetic": "T kinetic_energy",
    "energy": "T V U kinetic_energy potential_energy",
    "position_lower": "lower lower_limit limits position_limits qlim",
    "viscous": "damping",
    "coulomb": "frictionloss mu",
    "friction.coulomb": "frictionloss",
    "friction.viscous": "damping",
    "friction": "mu",
    "sim.dt": "dt timestep time_step step_size Ts",
    "robot.urdf": "urdf mjcf xml",
    "n": "nq nv dof dofs ndof",
    "q": "qpos pos position positions angles theta",
    "position": "q qpos",
    "v": "qd dq qdot qvel vel velocity velocities",
    "a": "qdd ddq qddot qacc acceleration accelerations",
    "q0": "q qpos position",
    "v0": "v qd qvel velocity",
    "tau": "torque torques effort u ctrl",
    "state": "data",
    "run": "simulate rollout",
    "time": "t times",
    "dt": "timestep time_step step_size Ts h",
    "duration": "T t tf seconds time",
    "control": "controller policy tau torque u",
    "frame": "link body end end_effector site",
    "frame_names": "frames links bodies",
    "integrator": "method solver",
    "method": "integrator solver",
    "dopri5": "RK45 ode45",
    "implicit": "Radau BDF LSODA ode15s implicitfast",
    "scene": "urdf robot model xml path",
    "arm_sim.view.show": "show view render viewer",
    "to_dict": "df dataframe to_csv to_pandas to_xarray",
    "x": "states",
    "pose_error": "missing",
    "account": "audit",
    "bandwidth": "kp wn omega",
    "damping_ratio": "kd zeta",
    "panda": "franka emika",
}


class ArmError(Exception):
    """Base of all errors of the suite."""


class SceneError(ArmError):
    """A scene file, or a part of it, cannot be used."""


class ModelError(SceneError):
    """The robot description cannot be used: malformed, unsupported or unphysical."""


class InvalidInput(ArmError, ValueError):
    """An argument has the wrong shape, an unknown name or a value that is not allowed."""


class UnknownArgument(InvalidInput, TypeError):
    """A keyword argument that a function or a class does not have."""


class NotAssignable(ArmError, FrozenInstanceError):
    """An attribute that an object does not have, or that is fixed, was to be set."""


class ConstraintError(SceneError, InvalidInput):
    """Constraints that cannot be closed from the robot's position.

    ``residuals`` are the remaining gaps of all constraints by name, in [m] or [rad].
    """

    def __init__(self, message: str, residuals: dict[str, float] | None = None) -> None:
        super().__init__(message)
        self.residuals = residuals or {}


class Unreachable(ArmError):
    """A pose or a path that the arm cannot reach; ``residual`` is the remaining error."""

    def __init__(self, message: str, residual: float = math.nan) -> None:
        super().__init__(message)
        self.residual = residual


class KernelError(ArmError):
    """Generated code cannot be compiled, or disagrees with Pinocchio and is rejected."""


class CompilerMissing(KernelError):
    """There is neither a compiler nor previously compiled code."""


class ControllerFailed(ArmError):
    """A user-defined controller raised an exception, or returned no valid torque."""


class NotWritten(ArmError, OSError):
    """The system does not let a file be written."""


class NoAnswer(ArmError, TimeoutError):
    """No node offers a service, or it did not answer in time."""


class Refused(ArmError):
    """A node refused a request; the message is the node's."""


def missing(module: object, extra: str) -> str:
    """Message about a module of one of the suite's extras, which installs it."""
    by_pip = f'pip install ".[{extra}]", in the project\'s folder,'
    how = f"{ARM} setup {extra}" if ARM == "./arm" else by_pip
    return f"Python cannot find the module '{module}': {how} installs it"


def plain(text: object, most: int = 1000) -> str:
    """Untrusted text as a single line that is safe to print.

    Characters that are not printable (line breaks, marks of writing direction) are escaped, and
    the middle of a text of more than ``most`` is omitted.
    """
    whole = str(text)
    half = most // 2
    if len(whole) <= most:
        return _printable(whole)
    left_out = f" … ({len(whole) - 2 * half} characters) … "
    return _printable(whole[:half]) + left_out + _printable(whole[-half:])


def _printable(text: str) -> str:
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def known_names(names: Iterable[str], limit: int = 30) -> str:
    """List names as ``a, b, c``, an empty one as ``''``, with at most ``limit`` of them."""
    listed = [plain(name, _NAME) or "''" for name in names]
    more = f", … ({len(listed) - limit} more)" if len(listed) > limit else ""
    return (", ".join(listed[:limit]) + more) or "none"


def did_you_mean(name: object, names: Iterable[str], prefixes: Mapping[str, str] = {}) -> str:
    """A suggestion of the most similar name, as the end of a message; empty if none is similar.

    What other libraries call by the name comes first. Names that differ only in numbers are not
    similar: ``joint9`` does not suggest ``joint4``.

    Args:
        name: The unknown name.
        names: Those that there are.
        prefixes: Prefixes of further names, which may be meant but are not similar.
    """
    if not isinstance(name, str):
        return ""
    cased = {other.casefold(): other for other in names}
    inner = {x for x in ELSEWHERE if x.split(".")[0] in cased}
    whole, others = name.casefold(), [x for x in cased if _bare(cased[x]) != _bare(name)]
    part = sorted((other for other in others if len(other) > 3 and other in whole), key=len)
    near = [x for x, y in ELSEWHERE.items() if x in {*inner, *prefixes} and name in y.split()]
    near = near or get_close_matches(whole, others, 1, _ALMOST) or part[-1:]
    near = near or get_close_matches(whole, others, 1)
    if not near:
        return ""
    return f"; did you mean '{cased.get(near[0], prefixes.get(near[0], '') + near[0])}'?"


def counted(count: int, noun: str) -> str:
    """A number of things, whose name has a plural in s."""
    return f"{count or 'no'} {noun}{'s' * (count != 1)}"


def not_copied(instance: object, instead: str) -> ArmError:
    """The error for an object that holds compiled code, which ``copy`` and ``pickle`` lose."""
    name = type(instance).__name__
    return ArmError(f"a {name} holds compiled code: it cannot be copied or pickled; {instead}")


def degrees_meant(angle: float) -> str:
    """A remark on an angle in [rad] of so many turns that degrees are probably meant, or empty."""
    if not abs(angle) > _MANY_TURNS:
        return ""
    return f"{angle:.6g} is {angle / math.tau:.3g} turns; angles are in rad"


def choices(name: object, names: Iterable[str], limit: int = 30) -> str:
    """The text after ``allowed:``: the names, and a suggestion."""
    listed = list(names)
    return known_names(listed, limit) + did_you_mean(name, listed)


def _bare(name: str) -> str:
    return re.sub(r"\d", "", name)
