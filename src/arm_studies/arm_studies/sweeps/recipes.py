# SPDX-License-Identifier: Apache-2.0
"""From a study to worlds: groups of runs with common equations, and their differences."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import arm_sim
from arm_dynamics import ArmModel, Scene, load_scene
from arm_dynamics.exceptions import SceneError, choices
from arm_sim.plant.parameters import Parameters
from arm_studies.sweeps import keys
from arm_studies.sweeps.controllers import runs_compiled
from arm_studies.sweeps.design import Point, noise_seed
from arm_studies.sweeps.runs import Job, Recipe
from arm_studies.sweeps.study import Study

_PROBE = 1e-3  # relative change of a key's value that shows which quantity it is
_SOME_FRICTION = 1.0  # [N m] or [N], in equations whose levels are inputs
_LEAST_TIME = 1000.0  # [s] of simulated time of one world above which SIMD code is compiled
type Slots = dict[str, tuple[int, ...]]


@dataclass(frozen=True)
class Group:
    """The runs of one world.

    Attributes:
        scene: Its scene, as named in the study.
        values: Values that define the world, by key.
        slots: Indices of varied numbers in their tunable quantities, by key.
        jobs: Its runs.
    """

    scene: str | dict[str, Any]
    values: dict[str, Any]
    slots: Slots
    jobs: list[Job]


class Split(NamedTuple):
    """Runs that are simulated entirely in compiled code, and the others."""

    compiled: list[Job]
    others: list[Job]


class Planner:
    """Groups the runs of a study, and creates the recipes of their worlds.

    Attributes:
        study: The study.

    Raises:
        ArmError: If a scene cannot be used, or a key does not exist.
    """

    def __init__(self, study: Study) -> None:
        self.study, self._contents = study, dict[str, dict[str, Any]]()
        allowed = [*keys.STUDY_KEYS, *Scene.model_fields]
        for key in study.vary:
            if (first := key.partition(".")[0]) not in allowed:
                raise SceneError(
                    f"study: unknown key 'vary.{key}'; allowed here: {choices(first, allowed)}"
                )

    def groups(self, points: Sequence[Point]) -> list[Group]:
        """The runs grouped by worlds, in order."""
        slots: dict[str, Slots] = {}
        by_key: dict[str, Group] = {}
        for point in points:
            scene = point.values.get("scene", self.study.scene)
            name = repr(scene)
            if name not in slots:
                slots[name] = self._slots(self.content(scene), points)
            own, common = dict[str, Any](), dict[str, Any]()
            for key, value in point.values.items():
                if key in slots[name] or self._of_run(scene, key):
                    own[key] = value
                elif key != "scene":
                    common[key] = value
            group = by_key.setdefault(f"{name} {common!r}", Group(scene, common, slots[name], []))
            group.jobs.append(Job(point.index, noise_seed(self.study, point.sample), own))
        return list(by_key.values())

    def recipe(self, group: Group) -> Recipe:
        """The recipe of a group's world."""
        study, base = self.study, self.content(group.scene)
        of_study = keys.values_below(group.values, *keys.STUDY_KEYS)
        of_scene = {k: v for k, v in group.values.items() if k not in of_study}
        levels = {key: _SOME_FRICTION for key in group.slots if keys.tunable(key) == "coulomb"}
        content = keys.with_values(base, of_scene | levels)
        tuned = [keys.tunable(key) for key in group.slots]
        content["tunable"] = list(dict.fromkeys([*content.get("tunable", ()), *tuned]))
        loop = self._loop(of_study)
        model = loop["controller"].pop("scene", None)
        commands = content.get("commands") or {}
        return Recipe(
            scene=json.dumps(content),
            controller_scene=json.dumps(base if model is None else _content(load_scene(model))),
            controller=json.dumps(loop["controller"]),
            motion=json.dumps(loop["motion"]),
            duration=study.duration,
            metrics=study.metrics,
            slots=tuple(group.slots.items()),
            lanes=len(group.jobs) * study.duration >= _LEAST_TIME,
            imperfect=content.get("sensors") is not None
            or any(value for key, value in commands.items() if key != "gravity_compensated"),
        )

    def split(self, group: Group) -> Split:
        """The runs of a group by how they are simulated."""
        recipe, runs = self.recipe(group), Split([], [])
        for job in group.jobs:
            (runs.compiled if runs_compiled(recipe, job) else runs.others).append(job)
        return runs

    def inputs(self, groups: Sequence[Group]) -> dict[str, Any]:
        """Inputs of the results: the study, the content of its files, and the suite's version."""
        study, contents = self.study, dict[str, str]()
        for scene in {repr(group.scene): group.scene for group in groups}.values():
            name, content = str(scene)[:80], json.dumps(self.content(scene), sort_keys=True)
            # Two scenes may have the same first 80 characters.
            contents[name] = f"{contents.get(name, '')} {_digest(content)}".lstrip()
        inputs: dict[str, Any] = {
            "suite": arm_sim.__version__,
            "study": study.model_dump(mode="json", exclude_unset=True),
            "order of vary": list(study.vary),  # determines numbering and random numbers
            "content of scene": contents,
        }
        if study.controller.scene is not None or "controller.scene" in study.vary:
            scenes = [self.recipe(group).controller_scene for group in groups]
            inputs["content of controller.scene"] = _digest("\n".join(scenes))
        if study.motion.file is not None and "motion.file" not in study.vary:
            text = Path(study.motion.file).read_text("utf-8")
            inputs["content of motion.file"] = _digest(text)
        return inputs

    def _loop(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Controller and motion of the study with values by key."""
        loop = {
            "controller": self.study.controller.model_dump(mode="json"),
            "motion": self.study.motion.model_dump(mode="json"),
        }
        if isinstance(values.get("controller"), str):  # whose settings stay
            values = {"controller.name" if k == "controller" else k: v for k, v in values.items()}
        return keys.with_values(loop, values)

    def content(self, scene: str | dict[str, Any]) -> dict[str, Any]:
        """The content of a scene file with the study's changes merged into it."""
        name = repr(scene)
        if name not in self._contents:
            content = _content(load_scene(scene))
            if self.study.changes:
                changed = keys.overlaid(content, self.study.changes)
                try:
                    content = _content(load_scene(changed))
                except SceneError as error:
                    raise SceneError(f"study: 'changes': {error}") from None
            self._contents[name] = content
        return self._contents[name]

    def _of_run(self, scene: str | dict[str, Any], key: str) -> bool:
        """Whether a key changes no equation; with loop constraints, the initial state may."""
        if keys.below(key, ("initial",)):
            constraints = self.content(scene).get("constraints", ())
            return all(each["type"] == "contact" for each in constraints)
        return keys.below(key, keys.RUN_KEYS) and not keys.below(key, keys.EQUATION_KEYS)

    def _slots(self, content: dict[str, Any], points: Sequence[Point]) -> Slots:
        """Keys that are entries of the vector p, and their indices.

        This does not depend on the values that a key takes, otherwise results would depend on
        them.
        """
        slots = {}
        for key in self.study.vary:
            name = keys.tunable(key)
            if name is not None and all(keys.is_number(point.values[key]) for point in points):
                if places := _places(content, key, name):
                    slots[key] = places
        return slots


def _content(scene: Scene) -> dict[str, Any]:
    content = scene.model_dump(exclude_unset=True, mode="json", by_alias=True)
    return {"gravity": list(scene.gravity), **content}


def _digest(content: str) -> str:
    return hashlib.sha256(content.encode()).hexdigest()[:16]


def _places(content: Mapping[str, Any], key: str, name: str) -> tuple[int, ...]:
    """Indices of a key's value in a tunable quantity; none if the quantity is not that value.

    Determined from the model itself: between two values of the key, the quantity must differ only
    in that the one replaces the other.
    """
    current = keys.value_at(content, key)
    x = float(current) if keys.is_number(current) else 0.0
    probes = [x + k * _PROBE * max(abs(x), 1.0) for k in (1, 2)]
    try:
        models = [_model(content, key, name, value) for value in probes]
        parameters = [Parameters(model) for model in models]
        first, second = (each.of(name, each.nominal) for each in parameters)
    except SceneError:
        return ()  # no body has an inertia with this value alone; no friction is dry
    places = np.flatnonzero(first != second)
    if name == "coulomb" and not _scales(models, places):
        return ()
    if not places.size:
        raise SceneError(
            f"study: 'vary.{key}' changes nothing: entries of single joints take "
            "precedence over that of all joints"
        )
    replaced = (first[places] == probes[0]).all() and (second[places] == probes[1]).all()
    return tuple(places.tolist()) if replaced else ()


def _model(content: Mapping[str, Any], key: str, name: str, value: float) -> ArmModel:
    changed = keys.with_values(content, {key: value})
    changed["tunable"] = list(dict.fromkeys([*changed.get("tunable", ()), name]))
    return ArmModel(load_scene(changed))


def _scales(models: Sequence[ArmModel], places: NDArray[np.intp]) -> bool:
    """Whether levels of sliding alone distinguish the dry friction of two arms, at these joints.

    Levels at rest are then the same, and no friction model with states has them.
    """
    a, b = (model.friction for model in models)
    alike = all((f.static.mean == f.coulomb.mean)[places].all() for f in (a, b))
    return alike and np.array_equal(a.by_law.static.mean, b.by_law.static.mean)
