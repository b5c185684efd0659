# SPDX-License-Identifier: Apache-2.0
"""Origin of a recording: scene, method and versions."""

import platform
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from types import MappingProxyType
from typing import Self

import casadi
import numpy as np
import pinocchio

from arm_dynamics import InvalidInput, Scene
from arm_dynamics.scene.text import scene_of, scene_text
from arm_sim.integrators.methods import METHODS

SCENE_FILE, URDF_FILE = "scene.yaml", "robot.urdf"
OPEN_LOOP, CLOSED_LOOP = "given", "fed back"  # as files name them


@cache
def versions() -> Mapping[str, str]:
    """Versions of the computation; if one differs, the last bits of a replay may differ."""
    return MappingProxyType({
        "python": platform.python_version(), "numpy": np.__version__,
        "casadi": casadi.__version__, "pinocchio": pinocchio.__version__,
        "machine": f"{platform.system()} {platform.machine()}",
    })  # fmt: skip


@dataclass(frozen=True)
class Origin:
    """Origin of a recording; all that is needed to repeat a run, except its commands.

    Attributes:
        scene: The scene, with the quantities that were tunable at the end of the run.
        integrator: Name of the method.
        dt: Length of a tick in [s].
        tolerance: Scaled error per sub-step, None for steps of fixed length.
        source: Name or path of the scene when it was loaded; empty if unknown.
        open_loop: Whether its commands did not answer to the state.
        versions: Versions of the computation.
    """

    scene: Scene
    integrator: str
    dt: float
    tolerance: float | None
    source: str = ""
    open_loop: bool = False
    versions: Mapping[str, str] = field(default_factory=versions)

    def texts(self) -> dict[str, str]:
        """Files from which ``read`` restores the scene."""
        return {SCENE_FILE: scene_text(self.scene, URDF_FILE), URDF_FILE: self.scene.robot.urdf}

    def about(self) -> dict[str, str]:
        """The rest, as texts by name."""
        tolerance = "" if self.tolerance is None else repr(self.tolerance)
        return {
            "integrator": self.integrator, "dt": repr(self.dt), "tolerance": tolerance,
            "source": self.source, "commands": OPEN_LOOP if self.open_loop else CLOSED_LOOP,
            **{f"version of {k}": v for k, v in self.versions.items()},
        }  # fmt: skip

    @classmethod
    def read(cls, texts: Mapping[str, str], about: Mapping[str, str]) -> Self:
        """The origin from ``texts`` and ``about``.

        Raises:
            SceneError: If the scene cannot be used.
            InvalidInput: If something is missing or not allowed.
        """
        try:
            scene = scene_of(texts[SCENE_FILE], texts[URDF_FILE])
            integrator, dt, text = about["integrator"], float(about["dt"]), about["tolerance"]
            tolerance = float(text) if text else None
        except (KeyError, ValueError) as error:
            if isinstance(error, InvalidInput):
                raise
            raise InvalidInput(f"the recording has no valid origin: {error}") from None
        if integrator not in METHODS or not 0.0 < dt < np.inf:
            raise InvalidInput(
                f"the recording's method is '{integrator}' with dt = {dt!r}; allowed: "
                f"{', '.join(METHODS)} and a time above zero"
            )
        head = "version of "
        versions = {k.removeprefix(head): v for k, v in about.items() if k.startswith(head)}
        open_loop, source = about.get("commands") == OPEN_LOOP, about.get("source", "")
        return cls(scene, integrator, dt, tolerance, source, open_loop, versions)
