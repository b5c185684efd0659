# SPDX-License-Identifier: Apache-2.0
"""Motors, flexible joints and bristles from records with known parameters.

The records are solutions by SciPy's DOP853 at 1e-11, tick by tick, of equations written here.
"""

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from arm_dynamics import InvalidInput
from arm_studies.identification import drives
from arm_studies.identification.drives import JointTest, MotorRecord, SmallMotion
from arm_studies.identification.drives.law import Law, Trial
from arm_studies.identification.drives.matching import match

DT = 1e-3
MOTOR = {
    "resistance": 1.3, "inductance": 1.1e-3, "torque_constant": 0.052, "rotor_inertia": 6.2e-5,
    "rotor_damping": 4e-5, "coulomb": 3e-3,
}  # fmt: skip
JOINT = {
    "stiffness": 900.0, "damping": 0.8, "motor_inertia": 0.4, "motor_damping": 0.5,
    "link_inertia": 0.9, "link_damping": 0.2,
}  # fmt: skip
LUGRE = {
    "inertia": 0.1, "sigma0": 1e4, "sigma1": 20.0, "coulomb": 1.0, "static": 1.4,
    "stribeck_velocity": 0.05, "viscous": 0.4,
}  # fmt: skip
Slope = Callable[[np.ndarray, float], Sequence[float]]


def solved(slope: Slope, x0: Sequence[float], u: np.ndarray) -> np.ndarray:
    x = [np.array(x0, float)]
    for held in u[:-1]:
        run = solve_ivp(
            lambda _, y, held=held: slope(y, held), (0.0, DT), x[-1], method="DOP853", rtol=1e-11,
            atol=1e-14,
        )  # fmt: skip
        x.append(run.y[:, -1])
    return np.array(x)


def steps(seed: int, low: float, high: float, count: int, each: int) -> np.ndarray:
    return np.repeat(np.random.default_rng(seed).uniform(low, high, count), each)


def close(found: drives.Match, truth: dict[str, float], names: Sequence[str], rtol: float) -> None:
    values = {name: found.values[name] for name in names}
    assert values == pytest.approx({name: truth[name] for name in names}, rel=rtol)


def test_trials_of_one_law_at_different_rates_share_no_kernel() -> None:
    """By x' = -k x + u, whose solution is exact; trials of one law and length share kernels."""
    k, x, u = (ca.SX.sym(name) for name in "kxu")
    law, held, trials = Law(x, u, {"k": k}, u - k * x, x), steps(5, -1.0, 1.0, 12, 5), []
    for dt in (0.02, 0.03):
        y, fade = [1.0], np.exp(-2.0 * dt)
        for level in held[:-1]:
            y.append(y[-1] * fade + level / 2.0 * (1.0 - fade))
        columns = held[:, None], np.array(y)[:, None], np.ones(1), np.zeros((1, 1))
        trials.append(Trial(law, dt, *columns))
    assert match(trials, {"k": 1.5}).values == {"k": pytest.approx(2.0, rel=1e-6)}


# --- motors ------------------------------------------------------------------------------------


@cache
def motor_runs() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Voltage, and current and speed, of each test."""
    R, L, K, J, B, C = MOTOR.values()

    def free(x: np.ndarray, V: float) -> Sequence[float]:
        i, w = x
        return (V - R * i - K * w) / L, (K * i - B * w - C * np.sign(w)) / J

    def blocked(x: np.ndarray, V: float) -> Sequence[float]:
        return (V - R * x[0]) / L, 0.0

    def coast(x: np.ndarray, _: float) -> Sequence[float]:
        return 0.0, (-B * x[1] - C * np.sign(x[1])) / J

    there, away = steps(0, -6.0, 6.0, 20, 20), steps(1, 4.0, 12.0, 20, 20)
    return {
        "blocked": (there, solved(blocked, [0.0, 0.0], there)),
        "free": (away, solved(free, [1.0, 40.0], away)),
        "coast": (0.0 * there, solved(coast, [0.0, 150.0], there)),
    }


def motor_record(kind: Any, noise: float = 0.0, seed: int = 0, **more: Any) -> MotorRecord:
    V, x = motor_runs()[kind]
    rng = np.random.default_rng(seed)
    i, w = (x + noise * np.array([2.0, 100.0]) * rng.normal(size=x.shape)).T
    given = {"blocked": {"voltage": V, "current": i}, "coast": {"speed": w},
             "free": {"voltage": V, "current": i, "speed": w}}[kind]  # fmt: skip
    return MotorRecord.of(kind, DT * np.arange(len(V)), **(given | more))


@pytest.mark.parametrize("kinds", [("free",), ("blocked", "free", "coast")])
def test_a_motor_is_found_from_its_tests(kinds: Sequence[str]) -> None:
    found = drives.identify_motor([motor_record(kind) for kind in kinds])
    close(found, MOTOR, tuple(MOTOR), 1e-5)
    assert found.follows and set(found.estimates) == set(MOTOR)


def test_parameters_that_a_test_does_not_determine_are_named() -> None:
    """Blocked and coasting rotors determine friction over inertia only, and not K_t."""
    found = drives.identify_motor([motor_record("blocked"), motor_record("coast")])
    close(found, MOTOR, ("resistance", "inductance"), 1e-5)
    told = {"torque_constant", "rotor_inertia", "rotor_damping", "coulomb"}
    assert set(found.missing) == told


def test_a_measured_torque_separates_torque_and_voltage_constants() -> None:
    """With K_t 5 % below K_e: the measured torque is smaller by that."""
    i = motor_runs()["blocked"][1][:, 0]
    blocked = motor_record("blocked", torque=0.95 * MOTOR["torque_constant"] * i)
    found = drives.identify_motor([blocked, motor_record("free")])
    assert found.values["torque_constant"] == pytest.approx(0.95 * 0.052, rel=1e-6)
    assert found.values["back_emf_constant"] == pytest.approx(0.052, rel=1e-6)
    assert found.values["rotor_inertia"] == pytest.approx(0.95 * 6.2e-5, rel=1e-5)


def test_voltage_at_the_open_winding_determines_the_back_emf() -> None:
    coasting = motor_record(
        "coast", voltage=MOTOR["torque_constant"] * motor_runs()["coast"][1][:, 1]
    )
    found = drives.identify_motor([coasting])
    close(found, MOTOR, ("torque_constant",), 1e-6)
    assert "rotor_inertia" in found.missing


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    """Of 4 runs with 6 numbers each, 95 % intervals: 20 of 24 at least in 99 of 100 cases."""
    held = 0
    for seed in range(4):
        records = [motor_record(kind, 0.005, seed) for kind in motor_runs()]
        found = drives.identify_motor(records).estimates
        held += sum(abs(found[k].value - x) <= found[k].interval for k, x in MOTOR.items())
    assert held >= 20


def test_records_of_something_else_give_no_numbers() -> None:
    """The speed of another motor: voltage, current and speed are inconsistent."""
    V, x = motor_runs()["free"]
    wrong = MotorRecord.of(
        "free", DT * np.arange(len(V)), voltage=V, current=x[::-1, 0],
        speed=100.0 * np.sin(0.05 * np.arange(len(V))),
    )  # fmt: skip
    found = drives.identify_motor([wrong])
    assert not found.follows and not found.values and set(found.missing) == set(MOTOR)


# --- flexible joints ---------------------------------------------------------------------------


def test_a_flexible_joint_is_found_with_its_link_free() -> None:
    k, d, Jm, Bm, Jl, Bl = JOINT.values()

    def slope(x: np.ndarray, u: float) -> Sequence[float]:
        bent = k * (x[0] - x[2]) + d * (x[1] - x[3])
        return x[1], (u - bent - Bm * x[1]) / Jm, x[3], (bent - Bl * x[3]) / Jl

    u = steps(2, -20.0, 20.0, 25, 20)
    x = solved(slope, [0.0, 0.0, 0.0, 0.0], u)
    record = JointTest.of(DT * np.arange(len(u)), u, x[:, 0], x[:, 2])
    close(drives.identify_joint(record), JOINT, tuple(JOINT), 1e-5)


def test_a_flexible_joint_is_found_with_its_link_held() -> None:
    k, d, Jm = 900.0, 0.8, 0.4
    u = steps(3, -20.0, 20.0, 20, 20)
    x = solved(lambda x, u: (x[1], (u - k * (x[0] - 0.1) - d * x[1]) / Jm), [0.1, 0.0], u)
    found = drives.identify_joint(JointTest.of(DT * np.arange(len(u)), u, x[:, 0]))
    close(found, JOINT, ("stiffness", "damping", "motor_inertia"), 1e-5)
    assert not found.missing


# --- bristles ----------------------------------------------------------------------------------


def lugre_record(seed: int, most: float, count: int, each: int) -> SmallMotion:
    J, s0, s1, Fc, Fs, vs, s2 = LUGRE.values()

    def slope(x: np.ndarray, u: float) -> Sequence[float]:
        _, v, z = x
        rate = v - s0 * abs(v) * z / (Fc + (Fs - Fc) * np.exp(-((v / vs) ** 2)))
        return v, (u - s0 * z - s1 * rate - s2 * v) / J, rate

    u = steps(seed, -most, most, count, each)
    return SmallMotion.of(DT * np.arange(len(u)), u, solved(slope, [0.0, 0.0, 0.0], u)[:, 0])


def test_bristles_are_found_from_small_and_wide_motions() -> None:
    records = [lugre_record(1, 0.8, 13, 16), lugre_record(2, 3.2, 14, 24)]
    found = drives.identify_bristles(records)
    close(found, LUGRE, tuple(LUGRE), 1e-4)
    assert found.follows


def test_motions_below_breakaway_determine_stiffness_and_not_sliding_friction() -> None:
    """A third of the breakaway force contains no information on how friction falls with speed."""
    found = drives.identify_bristles([lugre_record(4, 0.3, 13, 16)])
    close(found, LUGRE, ("inertia", "sigma0"), 1e-3)
    assert {"coulomb", "stribeck_velocity"} <= set(found.missing)


# --- records of no use -------------------------------------------------------------------------

T = DT * np.arange(50)
USELESS: dict[str, Callable[[], object]] = {
    "kind = 'stalled'; allowed: blocked, free, coast":
        lambda: MotorRecord.of("stalled", T),  # type: ignore[arg-type]
    "needs voltage and current and speed; speed is missing in 50 of 50":
        lambda: MotorRecord.of("free", T, voltage=np.ones(50), current=T),
    "speed does not vary": lambda: MotorRecord.of("coast", T, speed=np.ones(50)),
    "times are not even: 0.02 s, then 0.026 s":
        lambda: MotorRecord.of("coast", np.where(T > 0.0205, T + 0.005, T), speed=T),
    "times do not increase": lambda: MotorRecord.of("coast", 0.0 * T, speed=T),
    "time 7 is not a finite": lambda: MotorRecord.of("coast", np.where(T == T[7], np.nan, T)),
    "at least 20 samples": lambda: MotorRecord.of("coast", T[:5], speed=T[:5]),
    "friction over inertia": lambda: drives.identify_motor([motor_record("coast")]),
    "no record of a motor": lambda: drives.identify_motor([]),
    "first guess of sigma0 = -1.0; a positive number":
        lambda: drives.identify_bristles([SmallMotion.of(T, T, -T)], {"sigma0": -1.0}),
    "torque is missing": lambda: JointTest.of(T, np.full(50, np.nan), T),
    "position is missing in some samples":
        lambda: SmallMotion.of(T, T, np.where(T == T[7], np.nan, np.cos(T))),
}  # fmt: skip


@pytest.mark.parametrize("said", USELESS)
def test_useless_records_are_refused(said: str) -> None:
    with pytest.raises(InvalidInput, match=said):
        USELESS[said]()
