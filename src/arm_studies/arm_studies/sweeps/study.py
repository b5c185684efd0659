# SPDX-License-Identifier: Apache-2.0
"""The study: one validated description of a sweep, read from YAML or a dictionary."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import pydantic

from arm_dynamics.exceptions import SceneError, choices
from arm_dynamics.scene.complaints import Schema, complaints
from arm_dynamics.scene.files import file_text, find_file, find_scene
from arm_dynamics.scene.lines import in_file, parse
from arm_dynamics.scene.types import Finite, NonNegative, Part, Positive
from arm_studies.sweeps.metrics import METRICS

# Source of a study; see ``load_study``.
type StudySource = str | os.PathLike[str] | Mapping[str, Any] | Study

_NAME = "study"
_VALUE_TYPES = (str, int, float, list)  # types of values in a list, besides true and false


def _check_scene(value: object) -> object:
    if not isinstance(value, str | Mapping):
        raise ValueError(
            "the name of a scene, a path, or a mapping as in a scene file is expected"
        )
    return value


SceneName = Annotated[str | dict[str, Any], pydantic.BeforeValidator(_check_scene)]


class Varied(Part):
    """Variation of one quantity: a list of values, or a distribution.

    A list may be written without its key.

    Attributes:
        values: List of values; several lists form a grid.
        uniform: Lowest and highest value of a uniform distribution.
        log_uniform: Lowest and highest value of a log-uniform distribution.
        normal: Mean and standard deviation of a normal distribution.
    """

    values: tuple[Any, ...] | None = None
    uniform: tuple[Finite, Finite] | None = None
    log_uniform: tuple[Positive, Positive] | None = None
    normal: tuple[Finite, NonNegative] | None = None

    @pydantic.model_validator(mode="before")
    @classmethod
    def _from_list(cls, data: object) -> object:
        if isinstance(data, list | tuple):
            return {"values": list(data)}
        if not isinstance(data, Mapping):
            raise ValueError(
                "a list of values or a distribution such as {uniform: [0, 1]} is expected"
            )
        return data

    @pydantic.model_validator(mode="after")
    def _check_alternatives(self) -> Varied:
        if len(self.model_fields_set) != 1:
            raise ValueError(f"exactly one of {', '.join(Varied.model_fields)} is expected")
        if self.values == ():
            raise ValueError("the list is empty; at least one value is expected")
        if unusable := [v for v in self.values or () if not isinstance(v, _VALUE_TYPES)]:
            raise ValueError(f"{unusable[0]!r} in the list; numbers, names or lists are expected")
        ends = self.uniform or self.log_uniform
        if ends and not ends[0] < ends[1]:
            raise ValueError("the lower end must lie below the upper one")
        return self


class ControllerChoice(Part):
    """The controller of a sweep.

    Attributes:
        name: One of ``arm_dynamics.control.NAMES``, or ``package.module:Class``.
        scene: Scene of its model; by default the study's without variations.
        settings: Its settings, by the names of ``arm_dynamics.control.Settings``.
    """

    name: str = "computed_torque"
    scene: SceneName | None = None
    settings: dict[str, Any] = {}

    @pydantic.model_validator(mode="before")
    @classmethod
    def _from_name(cls, data: object) -> object:
        return {"name": data} if isinstance(data, str) else data


class MotionPoint(Part):
    """A waypoint.

    Attributes:
        time: Time since the start in [s].
        position: Positions by joint in [rad] or [m]; other joints keep theirs.
    """

    time: Positive
    position: dict[str, Finite]


class MotionChoice(Part):
    """Reference motion: waypoints connected by quintic segments within the velocity limits.

    Attributes:
        points: Waypoints in order of time; empty to hold the initial position.
        file: A joint trajectory in place of waypoints, as ``arm excite`` writes it.
    """

    points: tuple[MotionPoint, ...] = ()
    file: str | None = None

    @pydantic.model_validator(mode="after")
    def _check_alternatives(self) -> MotionChoice:
        if self.points and self.file is not None:
            raise ValueError("points and file are given; one of them is expected")
        return self


class Study(Part):
    """A study; only the scene and the duration are required.

    Attributes:
        scene: The arm: name of a bundled scene, path (relative to the study), or a mapping as in a
            scene file.
        changes: Changes merged into the scene, as in a scene file.
        duration: Duration of each run in [s].
        controller: Name of the controller, or name and settings; ``vary`` may vary it.
        motion: Reference motion of the controller.
        vary: Varied quantities, by keys of the scene separated by dots, such as
            ``joints.*.friction.viscous`` or ``payloads.0.mass``; also ``scene``, ``controller``,
            ``controller.settings.NAME`` and ``motion.points.0.time``.
        samples: Number of samples of the distributions, the same at every point of the grid;
            without distributions, number of repetitions with different noise.
        sampling: ``random``: independent samples; ``latin_hypercube``: samples spread evenly over
            each quantity.
        seed: Seed of all random numbers.
        metrics: Metrics of each run; ``NAME.JOINT`` for one joint alone.
    """

    scene: SceneName
    changes: dict[str, Any] = {}
    duration: Positive
    controller: ControllerChoice = ControllerChoice()
    motion: MotionChoice = MotionChoice()
    vary: dict[str, Varied] = {}
    samples: Annotated[pydantic.StrictInt, pydantic.Field(ge=1, le=10_000_000)] = 1
    sampling: Literal["random", "latin_hypercube"] = "random"
    seed: Annotated[pydantic.StrictInt, pydantic.Field(ge=0, lt=2**63)] = 0
    metrics: tuple[str, ...] = (
        "tracking_rms", "tracking_max", "overshoot", "energy", "saturation", "stop_time",
    )  # fmt: skip

    @pydantic.field_validator("metrics")
    @classmethod
    def _check_metrics(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        if not value:
            raise ValueError(f"the list is empty; allowed: {choices('', METRICS)}")
        for metric in (name.partition(".")[0] for name in value):
            if metric not in METRICS:
                raise ValueError(f"unknown metric '{metric}'; allowed: {choices(metric, METRICS)}")
        return tuple(dict.fromkeys(value))


def load_study(source: StudySource) -> Study:
    """Read and check a study.

    Args:
        source: Path of a study file (YAML), a dictionary of the same shape, or a study, which is
            returned unchanged.

    Returns:
        The study, paths in it made absolute.

    Raises:
        SceneError: If a key is missing, unknown or not allowed; of a file, with its name and line.
    """
    if isinstance(source, Study):
        return source
    if isinstance(source, Mapping):
        return _resolved(validated(Study, dict(source)), Path.cwd())
    if not isinstance(source, str | os.PathLike):
        raise SceneError(
            f"study: {source!r} is of type {type(source).__name__}; a path or a dictionary is "
            "expected"
        )
    path = Path(source)
    content = file_text(path, "study", "a study (YAML)")
    with in_file(path):
        data = parse(content, _NAME, "'scene' and 'duration'")
        if "robot" in data and "scene" not in data:
            raise SceneError(f"this is a scene; a study is another file, with scene: {path.name}")
        return _resolved(validated(Study, data), path.resolve().parent)


def validated[P: Part](kind: type[P], data: Any, *place: str) -> P:
    """A study, or the part of it at a place, with the values of one run.

    Raises:
        SceneError: If a value is not allowed.
    """
    try:
        return kind.model_validate(data)
    except pydantic.ValidationError as error:
        errors = error.errors()
    for each in errors:
        each["loc"] = (*place, *each["loc"])
    raise SceneError("\n".join(complaints(errors, Schema(Study, {}, (), _NAME))))


def _resolved(study: Study, folder: Path) -> Study:
    """The study with absolute paths, which makes it independent of the working folder."""
    changes: dict[str, Any] = {"scene": _absolute(study.scene, folder)}
    if study.controller.scene is not None:
        scene = _absolute(study.controller.scene, folder)
        changes["controller"] = study.controller.model_copy(update={"scene": scene})
    if study.motion.file is not None:
        file = str(folder / study.motion.file)
        changes["motion"] = study.motion.model_copy(update={"file": file})
    varied = study.vary.get("scene")
    if varied is not None and varied.values is not None:
        values = tuple(_absolute(value, folder) for value in varied.values)
        changes["vary"] = {**study.vary, "scene": varied.model_copy(update={"values": values})}
    return study.model_copy(update=changes)


def _absolute(scene: Any, folder: Path) -> Any:
    """A scene with absolute paths; bundled scenes keep their bare names."""
    if isinstance(scene, str):
        path = find_scene(scene, folder)
        return scene if "/" not in scene and not (folder / scene).is_file() else str(path)
    if not isinstance(scene, dict):
        raise SceneError(f"study: 'vary.scene': {scene!r}; names of scenes or paths are expected")
    if not isinstance(robot := scene.get("robot"), dict):
        return scene
    texts = [(key, robot[key]) for key in ("urdf", "xacro") if isinstance(robot.get(key), str)]
    files = {k: str(find_file(x, folder)) for k, x in texts if not x.lstrip().startswith("<")}
    return {**scene, "robot": {**robot, **files}}
