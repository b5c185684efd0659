# SPDX-License-Identifier: Apache-2.0
"""The recording of a run: a motion in files, tables and figures."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn, Self

import numpy as np

from arm_dynamics import ArmModel, load_scene
from arm_dynamics.arrays import Array, read_only
from arm_dynamics.attributes import sealed, with_arguments
from arm_dynamics.exceptions import ARM, SceneError, counted, known_names, not_copied
from arm_sim.plant.plant import Plant
from arm_sim.recording.motion import RecordedMotion
from arm_sim.recording.origin import Origin
from arm_sim.recording.physics import physics_of


@sealed
@dataclass(frozen=True, repr=False)
class Recording(RecordedMotion):
    """A motion, tick by tick, to be saved, loaded, tabulated and drawn.

    ``Contents`` describes its arrays, ``RecordedMotion`` the quantities that follow from them.
    """

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write a file that ``load`` opens anywhere: scene and robot description are in it.

        Args:
            path: ``.mcap`` for ``ros2 bag``, PlotJuggler and Foxglove; without suffix a folder, as
                ``ros2 bag record`` creates it; of a robot, a ``.csv`` of its joint states. An
                existing file is replaced, with a warning.

        Returns:
            Path of the file or folder.

        Raises:
            InvalidInput: If the suffix is not supported, or the motion is not of a scene.
            NoRecording: If the folder does not exist.
            NotWritten: If the system does not let the file be written; an OSError.
        """
        from arm_sim.recording import files  # imports libraries that a run does not require

        return files.save(self, path, lambda: self.tau)

    @classmethod
    def load(
        cls, path: str | os.PathLike[str], scene: Any = None, *, topic: str | None = None
    ) -> Self:
        """Read a recording: one of ours, a bag of a robot, or a table.

        Args:
            path: A file of ``save``, or of before (``.npz``); a bag of ROS 2 (``.mcap``, ``.db3``
                or a folder of them) with joint states; or a ``.csv`` with columns ``time`` and
                ``position.NAME``, ``velocity.NAME``, ``effort.NAME``, or from ``ros2 topic echo
                --csv``.
            scene: For a recording without one: anything ``load_scene`` accepts.
            topic: Topic of the joint states, if a bag has several.

        Raises:
            NoRecording: If it does not exist.
            InvalidInput: If it is not a recording, or too damaged to be used.
            SceneError: If the scene cannot be used or is of another robot.
            OSError: If it cannot be read.
        """
        from arm_sim.recording import files

        contents = files.load(path, topic)
        physics = None if contents.origin is None else physics_of(contents.origin)
        loaded = cls(**vars(contents), physics=physics)
        return loaded if scene is None else loaded.of(scene)

    def of(self, scene: Any) -> Self:
        """A recording without a scene, combined with a scene and restricted to its joints.

        Raises:
            SceneError: If the scene cannot be used, or is of another robot.
        """
        loaded = load_scene(scene)
        model, names = ArmModel(loaded), self.joint_names
        if missing := [name for name in model.joint_names if name not in names]:
            raise SceneError(
                f"the recording is of another robot than the scene: it has no joint "
                f"{known_names(missing)}, but {known_names(names)}"
            )
        if self.origin is not None:
            raise SceneError(
                "the recording contains its own scene, which cannot be replaced "
                f"({ARM} replay --scene repeats it with another one)"
            )
        order = [names.index(name) for name in model.joint_names]
        plant, rows = Plant(model), len(self.time)
        q, v, command = (part[:, order] for part in (self.q, self.v, self.command))
        z = [plant.laws.initial(*pair) for pair in zip(q, v, strict=True)] if plant.nz else []
        dt = float(np.median(np.diff(self.time))) if rows > 1 else loaded.sim.dt
        origin = Origin(loaded, "rk4", dt, None)
        return replace(
            self, q=read_only(q), v=read_only(v), command=read_only(command),
            z=read_only(np.reshape(z, (rows, plant.nz))), joint_names=model.joint_names,
            p=read_only(np.tile(plant.parameters.nominal, (rows, 1))), origin=origin,
            left=(*self.left, *(name for name in names if name not in model.joint_names)),
            physics=physics_of(origin),
        )  # fmt: skip

    def to_dict(self) -> dict[str, Array]:
        """Columns by name, each of shape (k+1,), such as ``time`` and ``position.elbow``.

        Positions, velocities, efforts (torques on the joints), commands of joints with drives, and
        internal states.
        """
        parts = {"position": self.q, "velocity": self.v, "effort": self.tau}
        if not self.of_robot and self.plant.torques is not None:
            parts["command"] = self.command
        columns = {"time": self.time}
        for part, array in parts.items():
            columns |= {f"{part}.{name}": array[:, i] for i, name in enumerate(self.joint_names)}
        laws = self.plant.laws.names if self.z.shape[1] else ()
        return columns | {f"state.{name}": self.z[:, i] for i, name in enumerate(laws)}

    @with_arguments
    def plot(self, *others: Recording, joints: Sequence[str] = ()) -> Any:
        """Draw positions, velocities, torques and energies, unless they are zero all the time.

        Potential energies are counted from the least of all recordings; work and heat are those of
        the energy balance.

        Args:
            *others: Recordings to draw over this one, in other lines, without their events.
            joints: Joints to draw; if none is named all, or of many the seven that move most.

        Returns:
            A ``matplotlib.figure.Figure``.

        Raises:
            InvalidInput: If a joint is unknown, or recordings share none.
        """
        from arm_sim.recording.figure import draw

        return draw((self, *others), joints)

    @with_arguments
    def animate(
        self, path: str | os.PathLike[str] | None = None, *, rate: float = 30.0, speed: float = 1.0
    ) -> Any:
        """Show the motion as a film of a stick figure, as ``motion.animate("pendulum.gif")``.

        It is drawn along the axis of the world along which nothing moves, else in space.

        Args:
            path: GIF to write, or None.
            rate: Frames per second. Each lasts whole hundredths of a second: 30 become 33.
            speed: Speed of the film relative to real time.

        Returns:
            A ``matplotlib.animation.FuncAnimation``, which a notebook shows as a film.

        Raises:
            InvalidInput: If the file is no GIF, the recording has no scene, or a number is not
                positive.
            NotWritten: If the file cannot be written.
        """
        from arm_sim.recording.animation import animate

        return animate(self, None if path is None else Path(path), rate, speed)

    def __reduce_ex__(self, protocol: object) -> NoReturn:
        """Refuse to be copied or pickled.

        Raises:
            ArmError: Always; it says what to do instead.
        """
        raise not_copied(self, "save(path) and Recording.load(path) pass it on")

    def __repr__(self) -> str:
        """A summary: duration, origin, events, and the verdict, if it is computed."""
        span = f"{self.time[0]:g} to {self.time[-1]:g} s" if len(self) else "empty"
        joints = f"{counted(len(self.joint_names), 'joint')}: {known_names(self.joint_names, 8)}"
        lines = [f"{max(len(self) - 1, 0)} time steps, {span}", joints, *self._origin_texts()]
        for items, name in (
            (self.jumps, "changes between time steps"), (self.events, "events"),
            (self.gaps, "gaps: time steps are missing"),
        ):  # fmt: skip
            if items:
                lines.append(f"{len(items)} {name}")
        lines += [event.text for event in self.events if event.text.startswith("file: ")]
        return "<Recording: " + "\n  ".join(lines) + ">"

    def _origin_texts(self) -> list[str]:
        """Origin and verdict as text."""
        if self.of_robot:
            return ["measured: without a scene" if self.origin is None else "measured"]
        if self.origin is None or self.physics is None:
            return ["without a scene"]
        origin = self.origin
        control = "" if origin.tolerance is None else f", tolerance {origin.tolerance:g}"
        source = f" of {origin.source}" if origin.source else ""
        method = f"{origin.integrator}, dt {origin.dt:g} s{control}{source}"
        checked = "second_run" in vars(self)
        return [method, self.verdict if checked else "not checked yet: trusted does it"]
