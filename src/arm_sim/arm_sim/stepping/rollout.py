# SPDX-License-Identifier: Apache-2.0
"""Many arms at once: one in each lane of a vector register, groups of them on every core."""

from __future__ import annotations

import ctypes
import os
import re
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass
from functools import cache, partial
from itertools import compress, pairwise
from time import perf_counter
from types import MappingProxyType
from typing import Any

import casadi as ca
import numpy as np

from arm_dynamics import InvalidInput
from arm_dynamics.arrays import Array, all_finite, real_array, vector
from arm_dynamics.codegen import compiler
from arm_dynamics.codegen.header import Header
from arm_dynamics.codegen.kernel import generate
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.exceptions import CompilerMissing
from arm_sim.inputs import whole
from arm_sim.integrators.methods import build_tick
from arm_sim.integrators.selection import Choice
from arm_sim.long_runs import refuse_beyond_memory
from arm_sim.plant.actuation import CompiledControl, actuation
from arm_sim.plant.placing import closed_rows, inside_stops
from arm_sim.plant.plant import Plant, slope_of_loads
from arm_sim.stepping.engine import INCLUDED, NATIVE, Compiled, library, scene_source
from arm_sim.stepping.stepper import MOVING, Stepper, address, smooth_motion

ADDRESS, NUMBER = ctypes.c_void_p, ctypes.c_longlong
WIDTHS = (8, 4, 2, 1)
# Ticks of all arms from which code for error control or events side by side saves more time than
# its compilation takes: up to ten seconds for implicit methods.
MANY_TICKS = 100_000
# Work in [s] that is worth a thread; with 16 of them, less takes longer than alone.
WORTH_A_THREAD = 7e-4
# Ticks of groups of arms that surely take little time.
FEW_TICKS = 2000
# Functions of events that ticks without events ask for, see native/lanes/eventful_ticks.h.
PREDICTED = ("loads", "contact_geometry", "contact_inertia", "contact_close")
# How CasADi writes choices; C++ has no such operator for many arms at a time.
_SIGN = "x<0 ? -1 : x>0 ? 1 : x"
_CHOICE = re.compile(r"\((\w+)\?(\w+):0\)")


@dataclass(frozen=True)
class Batch:
    """Arms to advance and where their motion goes.

    Attributes:
        x0: Initial states (q, v, z), shape (b, nx).
        tau: Torques, shape (b, ticks, n); held or shared ones are repeated by strides of zero.
        p: Parameters, shape (b, np).
        steps: Ticks to advance.
        out: States, shape (b, steps + 1, nx), or (b, nx) for the last ones only.
        effort: With a controller, receives what acts in each tick, shape (b, steps, n); ``tau``
            are its references then, shape (b, steps, size).
    """

    x0: Array
    tau: Array
    p: Array
    steps: int
    out: Array
    effort: Array | None = None


class Engine(ctypes.Structure):
    """Functions of the compiled engine of one arm: ``engine_t`` of ``prediction.h``."""

    _fields_ = Header(NATIVE / "modes/prediction.h", only="engine_t").fields("engine_t")

    @classmethod
    def of(cls, stepper: Stepper) -> Engine:
        """Those of a scene with events."""
        assert stepper.compiled is not None
        found = (getattr(stepper.compiled.engine, name) for name, _ in cls._fields_[1:])
        places = (ctypes.cast(function, ctypes.c_void_p).value for function in found)
        return cls(stepper.compiled.scene.value, *places)


class ArmTable(ctypes.Structure):
    """Arms and their ticks for compiled code: ``arms_t`` of ``lanes.h``."""

    _fields_ = Header(NATIVE / "lanes/lanes.h", only="arms_t").fields("arms_t")

    @classmethod
    def of(
        cls, x0: Array, tau: Array, p: Array, dt: float, marks: Marks, engine: Engine | None
    ) -> ArmTable:
        """Those of some arrays, which must live as long.

        Args:
            x0: Initial states, shape (b, nx).
            tau: Commands, shape (b, ticks, n).
            p: Parameters, shape (b, np).
            dt: Length of a tick in [s].
            marks: Receives which arms are to be advanced alone.
            engine: In a scene with events.
        """
        by = *strides(tau, 2), *strides(p, 1)
        return cls(
            *map(address, (x0, tau, p)), *by, dt, tau.shape[1], marks.place,
            None if engine is None else ctypes.addressof(engine),
        )  # fmt: skip


class Rollouts:
    """Rollouts of one scene with one method; arms never influence one another.

    Args:
        plant: The equation of motion.
        choice: Method, tick and tolerance.
        stepper: For arms that are advanced alone, without controller; its state does not change.
        backend: As for ``Kernel``.
        control: Controller to compile in, if any: for ``side_by_side``.
    """

    def __init__(
        self,
        plant: Plant,
        choice: Choice,
        stepper: Stepper,
        backend: str,
        control: CompiledControl | None = None,
    ) -> None:
        self._plant, self._choice, self._stepper, self._control = plant, choice, stepper, control
        # Arms that meet a stop are advanced once more, alone. With dry friction or contacts, lanes
        # compute the motions without events, and the engine of one arm does the rest.
        self._smooth = plant.free or plant
        together = not self._smooth.eventful or choice.tolerance is None
        together &= not switches_unseen(plant)
        self._in_registers = together and backend != "vm"
        self._controlled = choice.tolerance is not None and not self._smooth.eventful
        self._libraries: dict[int, Compiled | None] = {}
        self._engine = Engine.of(stepper) if self._smooth.eventful else None
        self._resting: list[Stepper] = []

    def run(self, batch: Batch, threads: int | None, lanes: int | None) -> Array:
        """Advance a batch; see ``Simulator.rollout``."""
        wide, together = widths(lanes), self._in_registers
        short = self._choice.tolerance is None and not self._smooth.eventful
        if lanes is None and not (short or self._libraries):
            together &= len(batch.x0) * batch.steps >= MANY_TICKS
        code, width = self._library(wide) if together else (None, 1)

        marks = Marks(len(batch.x0))

        def work(first: int, last: int) -> None:
            if code is not None:
                self._in_lanes(code, batch, marks, first, last)
            alone = range(first, last) if code is None else marks.of(first, last)
            self._one_by_one(batch, alone, marks)

        share(len(batch.x0), width, threads, work, batch.steps, marks.halt)
        n = self._plant.model.n
        return batch.out[..., : 2 * n] if self._plant.nz else batch.out

    def side_by_side(self, batch: Batch) -> list[int] | None:
        """Advance arms in vector registers on this thread, bit for bit as each alone.

        Returns:
            Arms that come near a stop, or cannot be advanced, and must be advanced one by one;
            None if that holds for all: the scene has dry friction or contacts under error control,
            or there is no compiler.
        """
        code, arms = self._lanes_here(), len(batch.x0)
        if code is None:
            return None
        marks = Marks(arms)
        work = partial(self._in_lanes, code, batch, marks)
        share(arms, natural_width(), 1, work, batch.steps, marks.halt)
        return marks.of(0, arms)

    def prepare(self) -> None:
        """Compile what ``side_by_side`` needs, unless that is done."""
        self._lanes_here()

    def _lanes_here(self) -> Compiled | None:
        return self._library(widths(None))[0] if self._in_registers else None

    def batch(self, q0: Any, v0: Any, tau: Any, steps: int, p: Array, last_only: bool) -> Batch:
        """Check arguments; ``p`` is of shape (np,) or (b, np)."""
        whole("steps", steps, 0)
        x0 = self.states(p, q0=q0, v0=v0)
        arms, nx = x0.shape
        rows = np.ascontiguousarray(np.broadcast_to(p, (arms, p.shape[-1])))
        if not last_only:
            what = f"a rollout of {arms} arms over {steps} ticks"
            refuse_beyond_memory(arms * (steps + 1), 8 * nx, what, "last_only=True keeps the end")
        out = np.empty((arms, nx) if last_only else (arms, steps + 1, nx))
        return Batch(x0, self.by_tick("tau", tau, arms, steps), rows, int(steps), out)

    def states(self, p: Array, **given: Any) -> Array:
        """Check positions and velocities, and complete them to states, shape (b, nx).

        Args:
            p: Parameters, shape (np,) or (b, np).
            given: Positions and velocities, each of shape (b, n), by the names of the arguments.
        """
        plant, joints = self._plant, self._plant.model.joint_names
        n = len(joints)
        q, v = (np.atleast_2d(vector(name, x, joints)) for name, x in given.items())
        of_q, of_v = given
        for name, count in ((of_v, len(v)), ("parameters", len(p) if p.ndim == 2 else len(q))):
            if count != len(q):
                raise InvalidInput(f"{name}: {count} arms, but {of_q} has {len(q)}")
        x = closed_rows(plant, np.concatenate([q, v], axis=1), p)
        if stops := plant.model.stops:
            inside = stops.within(x[:, :n])
            for arm in np.flatnonzero((inside != x[:, :n]).any(axis=1)):
                inside_stops(plant, x[arm, :n], f"arm {arm}: ")  # which refuses all but rounding
            x[:, :n] = inside
        if plant.nz:
            z = [plant.laws.initial(*np.split(row, 2)) for row in x]
            x = np.concatenate([x, np.reshape(z, (len(x), -1))], axis=1)
        return np.ascontiguousarray(x)  # columns of q and v may lie side by side

    def by_tick(self, name: str, values: Any, arms: int, steps: int) -> Array:
        """Check numbers for the joints, of every arm and tick or shared; shape (b, ticks, n)."""
        n = self._plant.model.n
        array = np.ascontiguousarray(real_array(name, values))
        if array.shape not in ((n,), (arms, n), (arms, steps, n)):
            allowed = f"({n},), ({arms}, {n}) or ({arms}, {steps}, {n})"
            raise InvalidInput(f"{name} has shape {array.shape}; expected {allowed}")
        if not all_finite(array):
            raise InvalidInput(f"{name} has values that are not finite; finite ones are expected")
        if not array.size:  # of no ticks: nothing acts
            array = np.zeros(n)
        by_tick = array if array.ndim == 3 else np.atleast_2d(array)[:, None]
        return repeated(by_tick, (arms, max(1, steps), n))

    def _in_lanes(self, code: Compiled, batch: Batch, marks: Marks, first: int, last: int) -> None:
        """Advance arms side by side; those that would have met a stop are marked."""
        tau = batch.tau[:, : batch.steps]
        arms = ArmTable.of(batch.x0, tau, batch.p, self._choice.dt, marks, self._engine)
        rollout = code.engine.controlled_rollout if self._controlled else code.engine.rollout
        rollout(
            code.scene, ctypes.byref(arms), first, last, address(batch.out), batch.out.ndim == 2,
            None if batch.effort is None else address(batch.effort),
        )  # fmt: skip

    def _one_by_one(self, batch: Batch, arms: Sequence[int], marks: Marks) -> None:
        if not arms:
            return
        stepper = self._at_rest()
        n, nx, steps = self._plant.model.n, self._plant.nx, batch.steps
        trace, effort, notes = np.empty((steps, nx)), np.empty((steps, n)), np.empty((steps, 2))
        for arm in arms:
            stepper.restart()
            stepper.p[:] = batch.p[arm]
            x, tau = batch.x0[arm].copy(), batch.tau[arm]
            tau = np.ascontiguousarray(tau if batch.tau.strides[1] else tau[0])
            done = stepper.roll(x, tau, trace, effort, notes, lambda: marks.halted)
            if marks.halted:
                break
            trace[done:] = np.nan
            motion = np.vstack([batch.x0[arm], trace])
            batch.out[arm] = motion[-1] if batch.out.ndim == 2 else motion
        self._resting.append(stepper)

    def _at_rest(self) -> Stepper:
        """A stepper that no thread uses."""
        try:
            return self._resting.pop()
        except IndexError:
            return self._stepper.twin()

    def _library(self, wide: tuple[int, ...]) -> tuple[Compiled | None, int]:
        """Compiled code and the number of arms that it advances side by side."""
        for width in wide:
            if width not in self._libraries:
                self._libraries[width] = self._built(width)
            if (code := self._libraries[width]) is not None:
                return code, width
        return None, 1

    def _built(self, width: int) -> Compiled | None:
        if width == 1 and (self._choice.tolerance is not None or self._smooth.eventful):
            return None
        name = "controlled_rollout" if self._controlled else "rollout"
        types = [ADDRESS, NUMBER, NUMBER, ADDRESS, ctypes.c_int, ADDRESS]
        return built_of_lanes(self._written, width, name, types)

    def _written(self, width: int) -> str:
        plant, choice, control = self._smooth, self._choice, self._control
        if not self._controlled:
            plant = self._plant if plant.eventful else plant
            return ticks_of_lanes(plant, choice, width, control)
        functions = [smooth_motion(plant, choice), actuation(plant, control)]
        return lanes_source(plant, choice, functions, width, _inputs(control))


def ticks_of_lanes(
    plant: Plant, choice: Choice, width: int, control: CompiledControl | None = None
) -> str:
    """C of ticks of arms side by side, with what lanes ask for where there are events.

    Args:
        plant: Their equations, away from stops where these are all that causes events.
        choice: Method and tick.
        width: Number of arms.
        control: Controller to compile in, if any.
    """
    motion, actuate = smooth_motion(plant, choice), actuation(plant, control)
    if not plant.eventful:
        functions = [build_tick(motion, actuate)]
        return lanes_source(plant, choice, functions, width, _inputs(control))
    asked = [function for name, function in plant.events.items() if name in PREDICTED]
    functions = [slope_of_loads(plant), motion, actuate, *asked]
    if plant.has_sliding_modes:
        functions.append(smooth_motion(plant.variant(sliding=True), choice, MOVING))
    return lanes_source(plant, choice, functions, width, _inputs(control))


def _inputs(control: CompiledControl | None) -> dict[str, int]:
    return {} if control is None else {"nr": control.law.size1_in(1)}


def lanes_source(
    plant: Plant, choice: Choice, functions: Sequence[ca.Function], width: int,
    more: Mapping[str, int] = MappingProxyType({}),
) -> str:  # fmt: skip
    """C of functions and of their scene, see ``scene_source``, for ``width`` arms side by side."""
    code = generate(functions)
    if width == 1:
        head = '#include "scalar.h"\n'
    else:
        code = _CHOICE.sub(r"if_else_zero(\1,\2)", code).replace(_SIGN, "sign(x)")
        head = f'#define LANES {width}\n#include "lanes.hpp"\n'
    return f"{head}{code}{scene_source(plant, choice, functions, more=more)}"


def alike(plant: Plant, choice: Choice) -> bool:
    """Whether all arms take the same steps away from stops: smooth, without error control."""
    smooth = choice.tolerance is None and not (plant.free or plant).eventful
    return smooth and not switches_unseen(plant)


def switches_unseen(plant: Plant) -> bool:
    """Whether something switches at which lanes of arms away from their stops do not look."""
    return plant.free is not None and plant.layout.switches > 0


@one_at_a_time
def built_of_lanes(
    write: Callable[[int], str], width: int, name: str, types: Sequence[type],
    units: tuple[str, ...] = (), folders: tuple[str, ...] = (),
) -> Compiled | None:  # fmt: skip
    """Compiled code that ``write`` gives for ``width`` arms side by side; None if it cannot be.

    The engine's function ``name`` then takes the scene and arguments of those C types, plain
    integers among them; for ``units`` and ``folders`` see ``engine.library``.
    """
    language = "c++" if width > 1 else "c"
    if not compiler.may_build(language):  # writing it takes long
        return None
    try:
        own = compiler.build(write(width), language, local=INCLUDED).library
        engine = library(width, units, folders)
    except CompilerMissing:
        return None
    getattr(engine, name).argtypes = [ADDRESS, *types]  # engine[name] is another object each time
    return Compiled(own, engine)


def widths(lanes: int | None) -> tuple[int, ...]:
    """Numbers of lanes to try in turn: as requested, else the processor's and fewer; then one.

    Code compiled elsewhere, for all processors of a level, may be of fewer lanes than fit here.

    Raises:
        InvalidInput: If ``lanes`` is not one of ``WIDTHS``.
    """
    if lanes is not None and (isinstance(lanes, bool) or lanes not in WIDTHS):
        allowed = ", ".join(map(str, WIDTHS))
        raise InvalidInput(f"lanes = {lanes!r}; allowed: {allowed}")
    if lanes is not None:
        return (lanes, 1) if lanes > 1 else (1,)
    return WIDTHS[WIDTHS.index(natural_width()) :]


def natural_width() -> int:
    """Doubles in a vector register of the processor that code is compiled for."""
    present = compiler.instructions()
    return 8 if "avx512f" in present else 4 if "avx2" in present else 2


def repeated(array: Array, shape: tuple[int, ...]) -> Array:
    """The array in another shape, repeated by strides of zero."""
    return array if array.shape == shape else np.broadcast_to(array, shape)


def strides(array: Array, axes: int) -> list[int]:
    """Numbers from one entry to the next along the first axes."""
    return [stride // 8 for stride in array.strides[:axes]]


class Marks:
    """A mark for each arm, to be set by compiled code; before them one by which it is halted.

    Attributes:
        place: Address of the first.
    """

    def __init__(self, arms: int) -> None:
        self._all = (ctypes.c_char * (1 + arms))()
        self.place = ctypes.addressof(self._all) + 1

    def of(self, first: int, last: int) -> list[int]:
        """Those of some arms whose marks are set."""
        return list(compress(range(first, last), self._all.raw[1 + first :]))

    @property
    def halted(self) -> bool:
        """Whether compiled code is to return at its next tick, its results being of no use."""
        return self._all[0] != b"\0"

    def halt(self) -> None:
        """Halt it."""
        self._all[0] = b"\1"


def share(
    arms: int, width: int, threads: int | None, work: Callable[[int, int], None], ticks: int = 0,
    halt: Callable[[], None] = lambda: None,
) -> None:  # fmt: skip
    """Distribute arms over threads in whole groups; compiled code releases the interpreter lock.

    If they have many ticks, this thread only waits, so that signals are handled.

    Args:
        arms: Number of arms.
        width: Arms in a group.
        threads: Number of threads; None for one per core, or fewer if the time that the first
            group takes tells that they would not be worth it.
        work: Called with the first arm and the one after the last.
        ticks: Ticks of each arm.
        halt: Lets all that works return soon, after an exception.

    Raises:
        InvalidInput: If the number of threads is not positive.
    """
    if threads is not None:
        whole("threads", threads, 1)
    count, groups, done = threads or len(os.sched_getaffinity(0)), -(-arms // width), 0
    if threads is None and count > 1 and groups > 1 and ticks <= FEW_TICKS:
        start = perf_counter()
        work(0, width)
        count = min(count, 1 + int((groups - 1) * (perf_counter() - start) / WORTH_A_THREAD))
        done = 1
    count = max(1, min(count, groups - done))
    edges = [done + (groups - done) * i // count for i in range(count + 1)]
    parts = [(a * width, min(arms, b * width)) for a, b in pairwise(edges)]
    here = parts[: (groups - done) * ticks <= FEW_TICKS]
    if len(here) == len(parts) == 1:
        work(*here[0])
        return
    others = [_kept_threads().submit(work, *part) for part in parts[len(here) :]]
    try:
        for part in here:
            work(*part)
        wait(others)
    except BaseException:
        halt()
        raise
    finally:
        wait(others)
    for other in others:
        other.result()


@cache
def _kept_threads() -> ThreadPoolExecutor:
    """Threads besides the calling one: those that ended their work wait for more."""
    return ThreadPoolExecutor(len(os.sched_getaffinity(0)), "arms")


os.register_at_fork(after_in_child=_kept_threads.cache_clear)  # a fork has none of them
