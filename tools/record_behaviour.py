# SPDX-License-Identifier: Apache-2.0
"""Record what the suite on the Python path does, as texts; ``same_behaviour.py`` compares them.

Only names that users know are used (``load_scene``, ``Dynamics``, ``Simulator``, the commands and
the classes of the nodes), so that one recorder serves revisions that are built differently inside.
Generated C is seen by a compiler command that copies what it is given and then compiles it.
"""

from __future__ import annotations

import gzip
import hashlib
import json
import os
import pkgutil
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from importlib import import_module  # noqa: TID251 - what it records has no fixed place
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

FIXED = ("euler", "semi_implicit_euler", "midpoint", "heun", "rk4")
ADAPTIVE = ("dopri5", "dop853", "implicit", "auto")
METHODS = [(name, None) for name in (*FIXED, *ADAPTIVE)] + [(name, 1e-8) for name in ADAPTIVE]
LANES = (8, 4, 2, 1)
DURATION = 0.2  # [s] of simulated time
POINTS = 300  # enough for the code of batches
STATES = 5
SEED = 20

# Called as "CAPTURE COMPILER ARGUMENT...": keeps the source, then compiles it without optimizing.
CAPTURE = """#!/bin/sh
folder=$CAPTURED
for argument; do
    case $argument in
    *.c | *.cpp) cp "$argument" "$(mktemp "$folder/source.XXXXXX")" ;;
    -I*) cp "${argument#-I}"/*.h "${argument#-I}"/*.hpp "$folder/headers" 2>/dev/null ;;
    esac
done
exec "$@" -O0
"""
# CasADi ends what it writes for an exported function with this one.
LAST_FUNCTION = re.compile(r"^CASADI_SYMBOL_EXPORT int \w+_work_bytes\(.*?^}$", re.DOTALL | re.M)
EXPORTED = re.compile(r"^CASADI_SYMBOL_EXPORT int (\w+)\(const casadi_real", re.M)
INCLUDED = re.compile(r'^#include "(.*)"', re.M)
TIMING = re.compile(r"^ *time .*\n", re.M)


class Records:
    """Texts by name, kept in a folder by their digests.

    Args:
        folder: Where to; ``texts`` is made in it.
    """

    def __init__(self, folder: Path) -> None:
        self._texts = folder / "texts"
        self._texts.mkdir(parents=True, exist_ok=True)
        self.digests: dict[str, str] = {}

    def add(self, name: str, text: str) -> None:
        """Keep a text; a name that is there already is numbered."""
        number, first = 1, name
        while name in self.digests:
            number += 1
            name = f"{first} ({number})"
        digest = hashlib.sha256(text.encode()).hexdigest()
        self.digests[name] = digest
        place = self._texts / f"{digest}.gz"
        if not place.exists():
            place.write_bytes(gzip.compress(text.encode(), 1))

    def attempt(self, name: str, answer: Callable[[], Any]) -> None:
        """Keep numbers, or which exception came in their place; its words may change."""
        try:
            text = numbers(answer())
        except Exception as error:
            text = raised(error)
        self.add(name, text)


def raised(error: Exception) -> str:
    """Text of an exception: its class, and its words if it is not one of the suite's."""
    from arm_dynamics import ArmError

    words = "" if isinstance(error, ArmError) else f": {error}"
    return f"raised {type(error).__name__}{words}\n"


def numbers(answer: Any) -> str:
    """Text of arrays, or tuples of them, that tells any two different numbers apart."""
    if isinstance(answer, tuple):
        return "\n".join(map(numbers, answer))
    array = np.asarray(answer, dtype=np.float64)
    rows = array.reshape(len(array), -1) if array.ndim and array.size else array.reshape(-1, 1)
    lines = [" ".join(map(repr, row)) for row in rows.tolist()]
    return "\n".join([f"shape {array.shape}", *lines, ""])


def generator() -> np.random.Generator:
    """The same random numbers at every call."""
    return np.random.default_rng(SEED)


def label(method: str, tolerance: float | None) -> str:
    """Name of a method with or without error control."""
    return method if tolerance is None else f"{method} to {tolerance:g}"


# --- generated code ----------------------------------------------------------------------------


@contextmanager
def capture() -> Iterator[Callable[[], tuple[list[str], dict[str, str]]]]:
    """Catch what is compiled meanwhile, with nothing in the cache.

    Yields:
        Function that returns the sources so far and the headers by name.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "headers").mkdir()
        command = folder / "capture"
        command.write_text(CAPTURE)
        command.chmod(0o700)
        before = dict(os.environ)
        os.environ |= {"CAPTURED": name, "XDG_CACHE_HOME": str(folder / "cache")}
        os.environ["CC"] = f"{command} {before.get('CC', 'cc')}"
        os.environ["CXX"] = f"{command} {before.get('CXX', 'c++')}"
        try:
            yield lambda: (
                [path.read_text() for path in folder.glob("source.*")],
                {path.name: path.read_text() for path in (folder / "headers").iterdir()},
            )
        finally:
            os.environ.clear()
            os.environ.update(before)


def record_code(records: Records, path: Path) -> None:
    """Everything that is compiled for a scene: generated functions and drivers apart."""
    for case, act in code_cases(path):
        with capture() as compiled:
            try:
                act()
            except Exception as error:
                records.add(f"c/{path.stem}/{case}, end", raised(error))
            keep_sources(records, f"{path.stem}/{case}", *compiled())


def keep_sources(records: Records, case: str, sources: list[str], headers: dict[str, str]) -> None:
    """Divide sources into the part that CasADi wrote and the driver after it."""
    for source in sorted(sources):
        end = max((match.end() for match in LAST_FUNCTION.finditer(source)), default=0)
        generated, driver = source[:end], source[end:]
        functions = ", ".join(EXPORTED.findall(source))
        if generated:
            records.add(f"c/{case}: {functions}", generated)
        if driver.strip():
            records.add(f"drivers/{case}: {functions}", driver)
        for header in INCLUDED.findall(source):
            if f"drivers/header {header}" not in records.digests:
                records.add(f"drivers/header {header}", headers.get(header, "not found\n"))


def code_cases(path: Path) -> Iterator[tuple[str, Callable[[], Any]]]:
    """What makes the suite compile something for a scene, by name."""
    for method, tolerance in METHODS:
        lanes = () if tolerance else LANES if method == "rk4" else LANES[:1]
        yield label(method, tolerance), partial(simulate, path, method, tolerance, lanes)
    for term in batch_terms(path):
        yield f"batch, {term}", partial(batch, path, term)
    yield "controlled", partial(controlled, path, 2)
    yield "controller", partial(compiled_controller, path)


def simulate(path: Path, method: str, tolerance: float | None, lanes: tuple[int, ...]) -> None:
    """Make a simulator, and rollouts with so many arms side by side."""
    from arm_sim import Simulator

    sim = Simulator(path, integrator=method, tolerance=tolerance)
    for width in lanes:
        roll_out(sim, width, 2)


def roll_out(sim: Any, lanes: int, steps: int) -> Any:
    """States of nine arms near a scene's start."""
    rng = generator()
    q = sim.state.q + 1e-3 * rng.uniform(-1, 1, (9, sim.n))
    v = sim.state.v + 1e-3 * rng.uniform(-1, 1, (9, sim.n))
    tau = torques(sim, steps)
    return sim.rollout(q, v, np.tile(tau, (9, 1, 1)), steps, lanes=lanes)


def torques(sim: Any, ticks: int) -> Any:
    """Random commands of the size of the arm's weight, shape (ticks, n)."""
    size = 1.0 + abs(sim.dynamics.gravity(sim.state.q))
    return size * generator().uniform(-1, 1, (ticks, sim.n))


def batch_terms(path: Path) -> dict[str, Callable[[Any, Any, Any, Any], Any]]:
    """Questions to a ``Dynamics`` about q, v and a, by name."""
    return {
        "inverse": lambda d, q, v, a: d.inverse(q, v, a),
        "command": lambda d, q, v, a: d.command(q, v, a),
        "forward": lambda d, q, v, a: d.forward(q, v, a),
        "mass_matrix": lambda d, q, v, a: d.mass_matrix(q),
        "coriolis_matrix": lambda d, q, v, a: d.coriolis_matrix(q, v),
        "gravity": lambda d, q, v, a: d.gravity(q),
        "energy": lambda d, q, v, a: d.energy(q, v),
        "friction": lambda d, q, v, a: d.friction(v, q=q),
        "constrained_forward": lambda d, q, v, a: d.constrained_forward(q, v, a),
    }


def batch(path: Path, term: str, points: int | None = POINTS) -> Any:
    """A term at many seeded points, or at one if ``points`` is None."""
    from arm_dynamics import Dynamics, load_scene

    dynamics, rng = Dynamics(load_scene(path)), generator()
    shape = (3, dynamics.n) if points is None else (3, points, dynamics.n)
    return batch_terms(path)[term](dynamics, *rng.uniform(-2, 2, shape))


def controlled(path: Path, ticks: int) -> Any:
    """Motion under computed torque compiled into the simulator."""
    from arm_sim import Simulator, computed_torque

    sim = Simulator(path)
    start = sim.state.q.copy()

    def sample(t: float) -> Any:
        still = np.ones(sim.n)
        return SimpleNamespace(q=start + 0.1 * t * t, v=0.2 * t * still, a=0.2 * still)

    recording = sim.run(ticks * sim.dt, computed_torque(sim.model, sample))
    return recording.q, recording.v, recording.command


def compiled_controller(path: Path) -> Any:
    """Torques of the compiled controller of ``arm_dynamics``, which no package exports."""
    from arm_dynamics import Dynamics, load_scene

    control = class_named("arm_dynamics", "CompiledComputedTorque")
    dynamics, rng = Dynamics(load_scene(path)), generator()
    law = control(dynamics, 20.0)
    answers = []
    for _ in range(STATES):
        q, v, qd, vd, a = rng.uniform(-2, 2, (5, dynamics.n))
        answers.append(law.torque(SimpleNamespace(q=q, v=v), SimpleNamespace(q=qd, v=vd, a=a)))
    return np.array(answers)


def class_named(package: str, name: str) -> Any:
    """Find a class wherever in a package it is defined."""
    root = import_module(package)
    for module in pkgutil.walk_packages(root.__path__, f"{package}."):
        if ".ros" in module.name or ".client" in module.name:
            continue
        found = vars(import_module(module.name)).get(name)
        if found is not None:
            return found
    raise LookupError(f"{package} has no {name}")


# --- motion and terms --------------------------------------------------------------------------


def record_motion(records: Records, path: Path) -> None:
    """States of short runs by every method, and everything that is computed from states."""
    from arm_sim import Simulator

    scene, smooth = path.stem, is_smooth(path)
    for backend in ("native", "vm") if smooth else ("native",):
        for method, tolerance in METHODS:
            case = f"{scene}/{label(method, tolerance)}, {backend}"
            record_run(
                records, case, path, integrator=method, tolerance=tolerance, backend=backend
            )
    sim = Simulator(path, integrator="rk4")
    for lanes in LANES:
        records.attempt(
            f"states/{scene}/rollout, {lanes} lanes", partial(roll_out, sim, lanes, 50)
        )
    records.attempt(f"states/{scene}/controlled", partial(controlled, path, 100))
    records.attempt(f"terms/{scene}/controller", partial(compiled_controller, path))
    for term in batch_terms(path):
        records.attempt(f"terms/{scene}/{term}", partial(batch, path, term, None))
        records.attempt(f"terms/{scene}/{term}, batch", partial(batch, path, term))


def is_smooth(path: Path) -> bool:
    """Whether nothing sticks, slides or is struck in a scene."""
    from arm_dynamics import Dynamics, load_scene

    slow = np.full(Dynamics(load_scene(path)).n, 1e-9)
    slides = abs(Dynamics(load_scene(path)).friction(slow, q=slow)).max() > 1e-6
    return not slides and "type: contact" not in path.read_text()


def record_run(records: Records, case: str, path: Path, **options: Any) -> None:
    """A run under seeded torques, its energies, the derivatives of a tick, ticks by hand."""
    from arm_sim import SimulationDiverged, Simulator

    try:
        sim = Simulator(path, **options)
    except Exception as error:
        records.add(f"states/{case}", raised(error))
        return
    try:
        run = sim.run(DURATION, torques(sim, round(DURATION / sim.dt)))
    except SimulationDiverged as error:
        records.add(f"states/{case}, end", raised(error))
        run = error.recording
    records.attempt(f"states/{case}", lambda: (run.q, run.v, run.z, run.command, run.error))
    energies = ("kinetic", "potential", "stored", "supplied", "lost", "multipliers")
    for name in energies:
        records.attempt(f"states/{case}, {name}", partial(getattr, run, name))
    tau = torques(sim, 1)[0]
    records.attempt(f"terms/{case}, linearize", lambda: sim.linearize(sim.state, tau))
    records.attempt(f"states/{case}, ticks", lambda: np.array([tick(sim, tau) for _ in range(5)]))
    records.attempt(f"states/{case}, reset", lambda: state_of(sim.reset()))


def tick(sim: Any, tau: Any) -> Any:
    """The state after one tick."""
    return state_of(sim.step(tau))


def state_of(state: Any) -> Any:
    """Numbers of a state in a row."""
    return np.concatenate([state.q, state.v, state.z, [state.time, state.error]])


# --- commands ----------------------------------------------------------------------------------


def ask(*words: str) -> str:
    """What a command prints."""
    done = subprocess.run(
        [sys.executable, "-P", "-m", "arm_sim.cli", *words],
        env=os.environ | {"COLUMNS": "200", "NO_COLOR": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    return done.stdout if done.returncode == 0 else f"status {done.returncode}\n{done.stderr}"


def record_help(records: Records, *words: str) -> None:
    """Help of a command and of those under it."""
    text = ask(*words, "--help")
    records.add(f"help/{' '.join(('arm', *words))}", text)
    _, _, commands = text.partition("\nCommands:\n")
    for line in commands.partition("\n\n")[0].splitlines():
        if match := re.match(r"  ([\w-]+)", line):
            record_help(records, *words, match.group(1))


def record_description(records: Records, path: Path) -> None:
    """What ``describe`` says of a scene, but for the time, which is measured."""
    records.add(f"describe/{path.stem}/description", TIMING.sub("", ask("describe", str(path))))


# --- nodes -------------------------------------------------------------------------------------


def record_nodes(records: Records, scenes: Path) -> None:
    """Parameters, topics, services and timers of the nodes, and joint states as bytes."""
    try:
        import rclpy
        from rclpy.context import Context
    except ImportError:
        return
    context = Context()
    rclpy.init(args=[], context=context, domain_id=1 + os.getpid() % 100)
    from arm_dynamics.ros.controller_node import ControllerNode
    from arm_dynamics.ros.dynamics_node import DynamicsNode
    from arm_sim.ros.sim_node import SimNode

    cases = {
        "sim": (SimNode, "panda", {"realtime": False}),
        "sim in lockstep": (SimNode, "panda", {"lockstep": True, "publish_clock": True}),
        "sim with constraints": (SimNode, "panda_pen", {"realtime": False}),
        "dynamics": (DynamicsNode, "panda", {}),
        "dynamics without scene": (DynamicsNode, None, {}),
        "controller": (ControllerNode, "panda", {}),
    }
    for case, (kind, scene, parameters) in cases.items():
        path = None if scene is None else str(scenes / f"{scene}.yaml")
        with node_of(kind, path, context, parameters) as node:
            records.add(f"ros/{case}, parameters", parameter_table(node))
            records.add(f"ros/{case}, endpoints", endpoint_table(node))
            records.add(f"ros/{case}, graph", graph_table(node))
    for scene in ("two_link", "panda", "motor_pendulum"):
        path, parameters = str(scenes / f"{scene}.yaml"), {"realtime": False}
        with node_of(SimNode, path, context, parameters) as node:
            records.add(f"messages/{scene}, joint states", joint_states(node, context))
    context.try_shutdown()


@contextmanager
def node_of(kind: Any, scene: Any, context: Any, parameters: dict[str, Any]) -> Iterator[Any]:
    """A node, taken down in the end."""
    from rclpy.parameter import Parameter

    overrides = [Parameter(name, value=value) for name, value in parameters.items()]
    node = kind(scene, context=context, parameter_overrides=overrides)
    try:
        yield node
    finally:
        node.destroy_node()


def parameter_table(node: Any) -> str:
    """Parameters with type, value, description, and what is allowed."""
    present = node.get_parameters_by_prefix("")
    lines = []
    for name in sorted(present):
        parameter, about = present[name], node.describe_parameter(name)
        ranges = [
            (item.from_value, item.to_value, item.step)
            for item in (*about.floating_point_range, *about.integer_range)
        ]
        facts = (about.description, about.additional_constraints, about.read_only)
        lines.append(
            f"{name}: {parameter.type_.name} = {parameter.value!r} {facts} {ranges} "
            f"dynamic {about.dynamic_typing}"
        )
    return "\n".join([*lines, ""])


def endpoint_table(node: Any) -> str:
    """Publishers, subscriptions, services, clients and timers with their QoS."""
    lines = [f"publishes {x.topic_name} {named(x.msg_type)} {qos(x)}" for x in node.publishers]
    lines += [f"listens {x.topic_name} {named(x.msg_type)} {qos(x)}" for x in node.subscriptions]
    lines += [f"serves {x.srv_name} {named(x.srv_type)} {qos(x)}" for x in node.services]
    lines += [f"asks {x.srv_name} {named(x.srv_type)} {qos(x)}" for x in node.clients]
    lines += [f"timer {x.timer_period_ns} ns" for x in node.timers]
    return "\n".join([*sorted(lines), ""])


def named(kind: Any) -> str:
    """Package and name of an interface type."""
    return f"{kind.__module__.split('.')[0]}/{kind.__name__}"


def qos(endpoint: Any) -> str:
    """What a profile says, as far as the middleware is told."""
    profile = endpoint.qos_profile
    policies = (profile.reliability, profile.durability, profile.history, profile.liveliness)
    names = " ".join(policy.name for policy in policies)
    durations = profile.deadline.nanoseconds, profile.lifespan.nanoseconds
    return f"{names} depth {profile.depth} deadline, lifespan {durations}"


def graph_table(node: Any) -> str:
    """Names, types and policies that others see, also of endpoints made under rclpy."""
    name, namespace = node.get_name(), node.get_namespace()

    def look() -> str:
        kinds = {
            "publisher": (
                node.get_publisher_names_and_types_by_node,
                node.get_publishers_info_by_topic,
            ),
            "subscription": (
                node.get_subscriber_names_and_types_by_node,
                node.get_subscriptions_info_by_topic,
            ),
            "service": (node.get_service_names_and_types_by_node, None),
            "client": (node.get_client_names_and_types_by_node, None),
        }
        return "\n".join(
            f"{kind} {topic} {types} {policies(name, about(topic) if about else [])}"
            for kind, (names, about) in kinds.items()
            for topic, types in sorted(names(name, namespace))
        )

    seen, since = look(), time.monotonic()
    while time.monotonic() - since < 0.5:
        time.sleep(0.05)
        if (now := look()) != seen:
            seen, since = now, time.monotonic()
    return seen + "\n"


def policies(node: str, endpoints: list[Any]) -> list[str]:
    """Reliability and durability of a node's endpoints; others are not told the depth."""
    return sorted(
        f"{x.qos_profile.reliability.name} {x.qos_profile.durability.name}"
        for x in endpoints
        if x.node_name == node
    )


def joint_states(node: Any, context: Any, ticks: int = 20) -> str:
    """Bytes of the joint states of some ticks under a seeded command, in hexadecimal."""
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from sensor_msgs.msg import JointState
    from std_msgs.msg import Float64MultiArray

    heard: list[bytes] = []
    peer = rclpy.create_node("listener", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    executor.add_node(peer)
    peer.create_subscription(JointState, "joint_states", heard.append, 10, raw=True)
    commands = peer.create_publisher(Float64MultiArray, "sim/commands", 10)

    def spin(done: Callable[[], bool]) -> None:
        end = time.monotonic() + 20.0
        while not done():
            if time.monotonic() > end:
                raise TimeoutError("the sim node was not heard")
            executor.spin_once(timeout_sec=0.01)

    spin(lambda: peer.count_publishers("joint_states") * commands.get_subscription_count() > 0)
    for _ in range(50):  # the other direction may be found a little later
        executor.spin_once(timeout_sec=0.01)
    heard.clear()
    commands.publish(Float64MultiArray(data=generator().uniform(-1, 1, node.simulator.n).tolist()))
    for _ in range(50):
        executor.spin_once(timeout_sec=0.01)
    for count in range(1, ticks + 1):
        node.tick()
        spin(lambda count=count: len(heard) >= count)
    executor.shutdown()
    peer.destroy_node()
    return "\n".join([*(bytes(message).hex() for message in heard), ""])


# --- one job -----------------------------------------------------------------------------------


def main() -> None:
    """Do one job: ``record_behaviour.py JOB SCENES SCENE FOLDER``."""
    job, scenes, scene, folder = sys.argv[1:]
    records, path = Records(Path(folder)), Path(scenes) / f"{scene}.yaml"
    jobs: dict[str, Callable[[], None]] = {
        "code": partial(record_code, records, path),
        "motion": partial(record_motion, records, path),
        "help": partial(record_help, records),
        "describe": partial(record_description, records, path),
        "nodes": partial(record_nodes, records, Path(scenes)),
    }
    jobs[job]()
    part = Path(folder) / f"{job}-{scene}.json"
    part.write_text(json.dumps(records.digests, indent=1, sort_keys=True))
    kinds = Counter(name.partition("/")[0] for name in records.digests)
    print(job, scene, dict(kinds), flush=True)


if __name__ == "__main__":
    main()
