# SPDX-License-Identifier: Apache-2.0
"""The simulation as a function of JAX and of PyTorch: the motions and gradients of Simulator."""

import sys
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import numpy as np
import pytest

from arm_dynamics import InvalidInput
from arm_sim import Simulator
from arm_studies.autodiff import JaxSimulator, TorchSimulator, jax_simulator, torch_simulator
from models import features
from tolerances import FINITE_DIFF, assert_close

type Arrays = dict[str, Any]
ARMS, TICKS = 3, 12


class Jax:
    """States, and gradients of Σ g · states, by JAX in double precision."""

    def __init__(self) -> None:
        import jax

        self.jax, self.of = jax, JaxSimulator

    def gradient(
        self, of: Callable[..., Any], g: np.ndarray, arguments: Arrays
    ) -> tuple[np.ndarray, Arrays]:
        def L(given: Arrays) -> Any:
            states = of(**given)
            return (states * g).sum(), states

        (_, states), found = self.jax.value_and_grad(L, has_aux=True)(arguments)
        return np.asarray(states), {name: np.asarray(x) for name, x in found.items()}


class Torch:
    """The same by PyTorch, with tensors that are where it is told."""

    def __init__(self, device: str = "cpu") -> None:
        self.torch, self.device = pytest.importorskip("torch", reason="PyTorch is missing"), device
        self.of = TorchSimulator

    def gradient(
        self, of: Callable[..., Any], g: np.ndarray, arguments: Arrays
    ) -> tuple[np.ndarray, Arrays]:
        leaves = {
            name: self.torch.tensor(value, requires_grad=True, device=self.device)
            for name, value in arguments.items()
        }
        states = of(**leaves)
        assert states.device.type == self.device
        (states * self.torch.tensor(g, device=self.device)).sum().backward()
        found = {name: leaf.grad.cpu().numpy() for name, leaf in leaves.items()}
        return states.detach().cpu().numpy(), found


class TorchOnGpu(Torch):
    """The same by PyTorch on a graphics processor, where there is one."""

    def __init__(self) -> None:
        super().__init__("cuda")
        if not self.torch.cuda.is_available():
            pytest.skip("there is no graphics processor")


with_jax = pytest.mark.group("jax")


@pytest.fixture(
    params=[pytest.param(Jax, marks=with_jax), Torch, TorchOnGpu], ids=["jax", "torch", "cuda"]
)
def library(request: pytest.FixtureRequest) -> Iterator[Any]:
    made = request.param()
    if isinstance(made, Torch):
        yield made
        return
    before = made.jax.config.read("jax_enable_x64")
    made.jax.config.update("jax_enable_x64", True)
    yield made
    made.jax.config.update("jax_enable_x64", before)


@cache
def arm(*chosen: str) -> Simulator:
    return Simulator(features.scene("planar", chosen), dt=1e-3, integrator="rk4")


def motion(sim: Simulator) -> tuple[Arrays, np.ndarray]:
    """Arguments of a rollout of some arms, and weights of its states."""
    rng, n = np.random.default_rng(3), sim.n
    q, v = sim.model.q0 + 0.1 * rng.normal(size=(ARMS, n)), 0.3 * rng.normal(size=(ARMS, n))
    z = np.array([sim.arm.plant.laws.initial(*pair) for pair in zip(q, v, strict=True)])
    x0 = np.hstack([q, v, z.reshape(ARMS, -1)])
    tau = 0.5 * rng.normal(size=(ARMS, TICKS, n))
    return {"x0": x0, "tau": tau}, rng.normal(size=(ARMS, TICKS + 1, x0.shape[1]))


def loaded(run: Any) -> Callable[..., Any]:
    """A rollout of arms by states, torques and payloads."""
    return lambda payload, **more: run.rollout(**more, parameters={"payload": payload})


def test_motions_and_gradients_are_those_of_the_simulator_to_the_bit(library: Any) -> None:
    sim = arm("payload")
    given, g = motion(sim)
    payload = np.tile(sim.arm.plant.parameters.nominal, (ARMS, 1))
    payload[:, 0] += [0.0, 0.1, 0.2]
    states, found = library.gradient(loaded(library.of(sim)), g, given | {"payload": payload})
    start, more = np.split(given["x0"], 2, axis=1), {"parameters": {"payload": payload}}
    there = sim.rollout(*start, given["tau"], TICKS, **more)
    np.testing.assert_array_equal(states, there)
    same = sim.rollout_gradient(*start, given["tau"], TICKS, g, **more)
    np.testing.assert_array_equal(found["x0"], np.hstack([same.q0, same.v0]))
    np.testing.assert_array_equal(found["tau"], same.tau)
    np.testing.assert_array_equal(found["payload"], same.parameters["payload"])


def test_gradients_are_those_of_differences(library: Any) -> None:
    """States of drives included, which a rollout of the simulator does not take."""
    sim = arm("voltage", "payload")
    given, g = motion(sim)
    given |= {"payload": np.array(sim.arm.plant.parameters.nominal)}
    run = loaded(library.of(sim))

    def L(**changed: Any) -> float:
        return float((np.asarray(run(**given | changed)) * g).sum())

    _, found = library.gradient(run, g, given)
    rng = np.random.default_rng(0)
    for name in ("x0", "tau"):
        way = rng.normal(size=given[name].shape)
        h = 1e-5 / np.abs(way).max()
        slope = (L(**{name: given[name] + h * way}) - L(**{name: given[name] - h * way})) / (2 * h)
        assert_close((found[name] * way).sum(), slope, FINITE_DIFF)
    mass = np.eye(10)[0] * 1e-5
    more, less = (L(payload=given["payload"] + s * mass) for s in (1.0, -1.0))
    assert found["payload"].shape == (10,)  # shared by the arms: a sum over them
    assert_close(found["payload"][0], (more - less) / 2e-5, FINITE_DIFF)


def test_steps_make_the_motion_of_a_rollout(library: Any) -> None:
    sim = arm("voltage", "payload")
    given, _ = motion(sim)
    run = library.of(sim)
    x, states = given["x0"], np.asarray(run.rollout(**given))
    for tick in range(TICKS):
        x = run.step(x, given["tau"][:, tick])
        np.testing.assert_array_equal(np.asarray(x), states[:, tick + 1])


@with_jax
def test_jax_compiles_and_maps() -> None:
    import jax

    sim = arm("payload")
    given, _ = motion(sim)
    run = JaxSimulator(sim).rollout

    def L(x0: Any, tau: Any) -> Any:
        return (run(x0, tau)[-1] ** 2).sum()

    with jax.enable_x64(True):
        whole = jax.jit(jax.vmap(jax.grad(L, 1), (0, None)))(given["x0"], given["tau"][0])
        each = [jax.grad(L, 1)(x0, given["tau"][0]) for x0 in given["x0"]]
        np.testing.assert_array_equal(whole, np.array(each))
    with jax.enable_x64(False):
        states = run(**given)
        assert states.dtype == np.float32
    assert_close(states, run_in_double(sim, given), 1e-6)


def run_in_double(sim: Simulator, given: Arrays) -> np.ndarray:
    return sim.rollout(*np.split(given["x0"], 2, axis=1), given["tau"], TICKS)


def test_torch_keeps_the_type() -> None:
    torch = pytest.importorskip("torch", reason="PyTorch is missing")
    sim = arm("payload")
    given, _ = motion(sim)
    run = TorchSimulator(sim)
    x0, tau = (torch.tensor(value[0, ..., :], requires_grad=True) for value in given.values())
    for kind, tolerance in ((torch.float32, 1e-6), (torch.bfloat16, 0.1)):
        less = run.rollout(x0.to(kind), tau.to(kind))
        assert less.dtype == kind
        assert_close(less.detach().double().numpy(), run_in_double(sim, given)[0], tolerance)
        less.sum().backward()


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"x0": np.zeros(3)}, r"x0 has shape \(3,\); expected \(…, 6\)"),
        ({"x0": np.zeros((2, 6)), "tau": np.zeros((3, TICKS, 3))}, "leading axes .*broadcast"),
        ({"tau": np.full((2, 3), np.nan)}, "tau has values that are not finite"),
        ({"parameters": {"payload": -np.ones(10)}}, "payload 0"),
    ],
)
def test_what_does_not_fit_is_refused(library: Any, changed: Arrays, said: str) -> None:
    sim = arm("payload")
    with pytest.raises(Exception, match=said):  # JAX wraps what is known only when it runs
        np.asarray(library.of(sim).rollout(**motion(sim)[0] | changed))


@pytest.mark.parametrize(("module", "of"), [("jax", JaxSimulator), ("torch", TorchSimulator)])
def test_missing_libraries_are_named(
    monkeypatch: pytest.MonkeyPatch, module: str, of: Callable[[Simulator], Any]
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    (jax_simulator if module == "jax" else torch_simulator)._simulated.cache_clear()
    with pytest.raises(InvalidInput, match=f"cannot find the module '{module}'"):
        of(arm("payload"))
