# SPDX-License-Identifier: Apache-2.0
"""The compiled functions of a scene, checked against Pinocchio before they are used."""

from pathlib import Path

import casadi as ca
import numpy as np

import arm_dynamics
from arm_dynamics import Dynamics
from arm_dynamics.arrays import Array
from arm_dynamics.codegen import compiled_scenes
from arm_dynamics.codegen.kernel import Kernel
from arm_dynamics.codegen.known_kernels import digest_of
from arm_dynamics.dynamics.checks import check_constrained, check_forward, sliding_directions
from arm_dynamics.equations.forward_dynamics import DENSE_AT_MOST
from arm_sim.integrators.selection import Choice
from arm_sim.plant.actuation import CompiledControl, actuation
from arm_sim.plant.plant import Plant
from arm_sim.stepping.engine import INCLUDED
from arm_sim.stepping.events import Modes
from arm_sim.stepping.reactions import set_switches
from arm_sim.stepping.scene_source import scene_source
from arm_sim.stepping.tick_functions import FREE, tick_functions


def build_kernel(
    plant: Plant, choice: Choice, backend: str, control: CompiledControl | None, acted: bool
) -> Kernel:
    """The functions of a scene, from the cache if they were kept there.

    Args:
        plant: The equation of motion.
        choice: Method, tick and tolerance.
        backend: As for ``Kernel``.
        control: Controller to compile in, if any.
        acted: Whether commands are torques that acted.

    Raises:
        KernelError: If the scene has events and there is no compiled code, or the code disagrees
            with Pinocchio.
    """
    compiled = control is None and backend in ("auto", "native")
    recipe = recipe_of(plant, choice, acted) if compiled else ""
    cached = Kernel.recall(recipe) if recipe else None
    kernel = cached or _compile_kernel(plant, choice, backend, control, acted)
    _check_accelerations(plant, kernel, "rhs")
    if plant.free:
        _check_accelerations(plant.free, kernel, f"{FREE}rhs")
    if recipe and not cached:
        kernel.keep(recipe)
    return kernel


def recipe_of(plant: Plant, choice: Choice, acted: bool) -> str:
    """Key of all inputs of a scene's code, with what of a model may differ from its scene.

    It is empty for few joints, whose code is quick to write, where ARM_CACHE lists folders: if the
    code in them cannot be used, ``build`` says why.
    """
    if plant.model.n <= DENSE_AT_MOST and compiled_scenes.folders():
        return ""
    sources = digest_of(str(Path(arm_dynamics.__file__).parent), str(Path(__file__).parents[1]))
    model = plant.model
    numbers = model.viscous.tolist(), model.command_limit.tolist()
    inputs = model.scene.model_dump(), numbers, plant.options, choice, acted
    return repr((inputs, sources, ca.__version__, np.__version__))


def _compile_kernel(
    plant: Plant, choice: Choice, backend: str, control: CompiledControl | None, acted: bool
) -> Kernel:
    """Generate and compile the equations of a scene."""
    actuate = actuation(plant, control, compensated=not acted)
    functions, smooth = tick_functions(plant, choice, actuate)
    driver = scene_source(plant, choice, functions, smooth)
    dry = ["dry friction"] if plant.model.has_dry_friction else []
    features = [*dry, *(["contact"] if plant.points else [])]  # that need the engine
    return Kernel(functions, backend, driver, " and ".join(features), INCLUDED)


def _check_accelerations(plant: Plant, kernel: Kernel, rhs: str) -> None:
    """Check the kernel's accelerations against Pinocchio before they are used."""
    call, dynamics, n = kernel.call(rhs), Dynamics(plant.model), plant.model.n
    modes = Modes(plant, plant.parameters.nominal)

    def acceleration(q: Array, v: Array, tau: Array) -> Array:
        slides = sliding_directions(v)
        modes.direction[:] = slides[: len(modes.direction)]  # none is at a stop
        x = np.concatenate([q, v, plant.laws.initial(q, v)])
        set_switches(modes, kernel, x, tau)
        a = call(x, tau, modes.p)[0][n : 2 * n]
        if plant.torques is None:
            return a
        # The laws change the torque that acts, and bristles are not deflected yet.
        acted, law = np.array(plant.torques(x, tau)[1]).ravel(), dynamics.steady_friction
        steady = [law(v, slides, q, load) for load in (acted, tau)]
        bent = law.of_laws(v, slides, q, acted)
        missing = tau - steady[1] - (acted - steady[0] + bent)
        if not plant.constrained:
            return a + np.linalg.solve(dynamics.mass_matrix(q), missing)
        still = np.zeros(n)
        constrained_acceleration = dynamics.constrained.without_sticking
        loaded: Array = constrained_acceleration(q, still, missing)[0]
        return a + (loaded - constrained_acceleration(q, still, still)[0])

    check = check_constrained if plant.constrained else check_forward
    check(dynamics, acceleration)
