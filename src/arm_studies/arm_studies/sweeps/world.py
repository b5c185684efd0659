# SPDX-License-Identifier: Apache-2.0
"""A world: what runs with the same equations share, and how it simulates one of them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import batched

import numpy as np

from arm_dynamics import ArmError, Dynamics, InvalidInput, load_scene
from arm_dynamics.actuation.command_map import rigid_twin
from arm_dynamics.arrays import Array, read_only
from arm_dynamics.control import AnyController, Measured, Settings, make_controller
from arm_dynamics.control.custom import is_own, load_controller
from arm_dynamics.scene import Scene, Sensors
from arm_dynamics.scene.effect import has_chance
from arm_dynamics.trajectory import Limits, Reference
from arm_sim import CompiledControl, SimulationDiverged, Simulator, State
from arm_sim.inputs import tick_count
from arm_sim.stepping import Batch, Rollouts, Stepper
from arm_studies.sweeps import course
from arm_studies.sweeps.controllers import IMPERFECT, controller_of, gains, law, runs_compiled
from arm_studies.sweeps.keys import tunable, values_below, with_values
from arm_studies.sweeps.metrics import RunRecord, evaluate
from arm_studies.sweeps.runs import DONE, Job, Recipe, Row
from arm_studies.sweeps.study import ControllerChoice, MotionChoice, validated

_LOOP = ("initial", "motion", "controller")  # keys of what is not the arm
_LEAST_LANES = 3  # smallest number of runs for which SIMD is worthwhile
_MOST_VALUES = 4_000_000  # largest number of values of runs that are simulated together
_CACHE_SIZE = 64  # number of courses, and of gains, of a world that are kept


class World:
    """Simulates runs one after another; no run depends on those before it.

    Args:
        recipe: Its inputs.

    Attributes:
        joint_names: Joints of the arm.

    Raises:
        ArmError: If the scene, the controller or the motion cannot be used.
    """

    def __init__(self, recipe: Recipe) -> None:
        self._recipe, self._content = recipe, json.loads(recipe.scene)
        self._scene = load_scene(self._content)
        self._simulator = simulator = Simulator(self._scene)
        model = rigid_twin(load_scene(json.loads(recipe.controller_scene)))
        self._dynamics = dynamics = Dynamics(model)
        self.joint_names = tuple(simulator.joint_names)
        if simulator.joint_names != dynamics.joint_names:
            raise InvalidInput(
                f"the controller's scene has joints {dynamics.joint_names}, the arm has "
                f"{simulator.joint_names}; the same are expected"
            )
        self._ticks = tick_count(recipe.duration, simulator.dt)
        self._nominal = simulator.arm.parameters
        self._slots = {key: list(places) for key, places in recipe.slots}
        # By their arguments as JSON, since mappings cannot be keys of a cache.
        self._course_of = lru_cache(_CACHE_SIZE)(self._course)
        self._gains_of = lru_cache(_CACHE_SIZE)(
            lambda name, settings: gains(name, dynamics, Settings(**json.loads(settings)))
        )

    def compile(self) -> None:
        """Compile the controller into the simulation, unless that is done."""
        _ = self._stepper
        if self._recipe.lanes:
            self._rollouts.prepare()

    def check(self, job: Job) -> None:
        """Check the inputs of a run before it is simulated.

        Raises:
            ArmError: If they are not allowed.
        """
        run = self._checked(job)
        if run.compiled:
            self._inputs(run)
        else:
            self._control(run)

    def rows(self, jobs: Sequence[Job]) -> list[Row]:
        """Simulate runs; a failure gives a row as well.

        Those with one start, one motion and one compiled controller are simulated side by side in
        vector registers if possible, with identical results.
        """
        rows, groups = dict[int, Row](), dict[str, list[_Run]]()
        for job in jobs:
            try:
                run = self._checked(job)
            except ArmError as error:
                rows[job.index] = Row.failed(job, error, self._recipe.metrics)
                continue
            loop = json.dumps(values_below(job.values, *_LOOP))
            together = run.compiled and self._recipe.lanes
            groups.setdefault(loop if together else f"{job.index}", []).append(run)
        size = (self._ticks + 1) * (self._simulator.arm.plant.nx + len(self.joint_names))
        for group in groups.values():
            for part in batched(group, max(1, _MOST_VALUES // size)):
                if len(part) >= _LEAST_LANES:
                    rows |= self._side_by_side(part)
                for run in part:
                    if run.job.index not in rows:
                        rows[run.job.index] = self._alone(run)
        return [rows[job.index] for job in jobs]

    # --- inputs of a job -----------------------------------------------------------------------

    def _checked(self, job: Job) -> _Run:
        """The inputs of a run, checked."""
        parameters = self._simulator.arm.plant.parameters
        named = {name: parameters.of(name, self._nominal).copy() for name in parameters.names}
        for key, places in self._slots.items():
            quantity = tunable(key)
            assert quantity is not None
            named[quantity][places] = job.values[key]
        p = parameters.merged(named, self._nominal)
        choice = controller_of(self._recipe, job)
        settings = {"dt": self._simulator.dt} | choice.settings
        choice = choice.model_copy(update={"settings": settings})
        x0, rows = self._course_of(json.dumps(values_below(job.values, "initial", "motion")))
        return _Run(job, p, x0, rows, choice, runs_compiled(self._recipe, job))

    def _course(self, values: str) -> tuple[Array, Array]:
        """Start and references at all ticks, of varied values: shapes (nx,), (ticks + 1, 3n)."""
        varied, names = json.loads(values), self.joint_names
        x0 = course.start(self._simulator, values_below(varied, "initial"))
        content = {"motion": json.loads(self._recipe.motion)}
        content = with_values(content, values_below(varied, "motion"))
        choice = validated(MotionChoice, content["motion"], "motion")
        limits = Limits.of(self._dynamics.model)
        trajectory = course.motion(choice, names, x0[: len(names)], limits)
        times = self._simulator.dt * np.arange(self._ticks + 1.0)
        return read_only(x0), read_only(course.references(trajectory, times))

    # --- runs ----------------------------------------------------------------------------------

    def _row(self, run: _Run, q: Array, torque: Array, command: Array) -> Row:
        """Metrics of positions, torques and commands."""
        model, n = self._simulator.model, len(self.joint_names)
        record = RunRecord(
            dt=self._simulator.dt, q=q, reference=run.rows[:, :n], torque=torque, command=command,
            limit=model.standing_limit, stops=model.stops.place,
        )  # fmt: skip
        values = evaluate(record, self._recipe.metrics, self.joint_names)
        return Row(run.job.index, DONE, "", tuple(values))

    def _alone(self, run: _Run) -> Row:
        """Simulate a run; an error gives a row as well."""
        try:
            return self._all_in_c(run) if run.compiled else self._closed_loop(run)
        except ArmError as error:
            return Row.failed(run.job, error, self._recipe.metrics)

    def _all_in_c(self, run: _Run) -> Row:
        """Simulate a run with its controller in compiled code."""
        stepper, n, ticks = self._stepper, len(self.joint_names), self._ticks
        trace, effort, notes = (np.empty((ticks, width)) for width in (len(run.x0), n, 2))
        stepper.restart()
        stepper.p[:] = run.p
        completed = stepper.advance(run.x0.copy(), self._inputs(run), trace, effort, notes)
        if completed < ticks:
            raise SimulationDiverged(f"at t = {(completed + 1) * self._simulator.dt:.6g} s")
        return self._compiled_row(run, np.vstack([run.x0, trace]), effort)

    def _compiled_row(self, run: _Run, states: Array, effort: Array) -> Row:
        """Metrics of states at all ticks, shape (ticks + 1, nx), and of efforts in each."""
        torque = self._simulator.arm.plant.joint_torque(states[1:], effort)
        # Contiguous, since sums depend on the memory layout
        q = np.ascontiguousarray(states[:, : len(self.joint_names)])
        return self._row(run, q, torque, effort)

    def _closed_loop(self, run: _Run) -> Row:
        """Simulate a run with its controller as a ``ClosedLoop`` runs it."""
        simulator, control = self._simulator, self._control(run)
        simulator.arm.imperfect(self._imperfect(run.job))
        simulator.arm.restore(run.x0, run.p, 0)
        references = [Reference(*np.split(row, 3)) for row in run.rows]

        def answer(state: State) -> Array:
            tau = control.torque(Measured(state.q, state.v), references[state.step])
            return np.asarray(self._dynamics.command_map(state.q, state.v, tau))

        try:
            motion = simulator.run(self._ticks * simulator.dt, answer)
        except SimulationDiverged as error:
            last = len(error.recording) * simulator.dt
            raise SimulationDiverged(f"at t = {last:.6g} s") from None
        return self._row(run, motion.q, motion.tau[:-1], motion.command[:-1])

    def _side_by_side(self, runs: Sequence[_Run]) -> dict[int, Row]:
        """Rows of runs with one start, motion and controller, but for those to simulate alone."""
        first, arms, n, ticks = runs[0], len(runs), len(self.joint_names), self._ticks
        try:
            inputs = self._inputs(first)
        except ArmError:
            return {}  # each run reports the error
        out, effort = np.empty((arms, ticks + 1, len(first.x0))), np.empty((arms, ticks, n))
        every = np.broadcast_to(inputs, (arms, *inputs.shape))
        p = np.array([run.p for run in runs])
        batch = Batch(np.tile(first.x0, (arms, 1)), every, p, ticks, out, effort)
        remaining = self._rollouts.run_in_lanes(batch)
        if remaining is None:
            return {}
        rows = dict[int, Row]()
        for i, run in enumerate(runs):
            if i not in remaining and np.isfinite(out[i, -1]).all():
                rows[run.job.index] = self._compiled_row(run, out[i], effort[i])
        return rows

    @cached_property
    def _control_law(self) -> CompiledControl:
        choice = ControllerChoice.model_validate_json(self._recipe.controller)
        return CompiledControl(law(choice.name, self._dynamics), _no_reference)

    @cached_property
    def _stepper(self) -> Stepper:
        scene = self._simulator.arm.compiled
        return Stepper(scene.plant, scene.choice, scene.backend, self._control_law)

    @cached_property
    def _rollouts(self) -> Rollouts:
        scene = self._simulator.arm.compiled
        return Rollouts(scene.plant, scene.choice, scene.stepper, scene.backend, self._control_law)

    def _inputs(self, run: _Run) -> Array:
        """Inputs of the compiled controller in each tick: references and gains."""
        tuning = self._gains_of(run.choice.name, json.dumps(run.choice.settings))
        return np.hstack([run.rows[:-1], np.broadcast_to(tuning, (self._ticks, len(tuning)))])

    def _control(self, run: _Run) -> AnyController:
        name, settings = run.choice.name, Settings(**run.choice.settings)
        maker = load_controller(name) if is_own(name) else name
        return make_controller(maker, self._dynamics, settings)

    def _imperfect(self, job: Job) -> Scene:
        """The scene with the sensors and command delays of a run, and its own noise."""
        varied = values_below(job.values, *IMPERFECT)
        if not (varied or self._recipe.imperfect):
            return self._scene
        scene = load_scene(with_values(self._content, varied))
        if "sensors.seed" in varied or not has_chance(scene):
            return scene
        sensors = (scene.sensors or Sensors()).model_copy(update={"seed": job.noise})
        return scene.model_copy(update={"sensors": sensors})


@dataclass(frozen=True)
class _Run:
    """A run with its inputs.

    Attributes:
        job: What it is.
        p: The vector p, shape (np,).
        x0: State at the start, shape (nx,).
        rows: References at all ticks, shape (ticks + 1, 3n).
        choice: Its controller, with the time step among its settings.
        compiled: Whether it is simulated entirely in compiled code.
    """

    job: Job
    p: Array
    x0: Array
    rows: Array
    choice: ControllerChoice
    compiled: bool


def _no_reference(times: Array) -> Array:
    raise InvalidInput(
        "the compiled controller of a sweep has no reference of its own; the sweep passes the "
        "references of every time step"
    )


@lru_cache(maxsize=8)
def world_of(recipe: Recipe) -> World:
    """The world of a recipe, cached by each process for later runs."""
    return World(recipe)
