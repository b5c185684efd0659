# SPDX-License-Identifier: Apache-2.0
"""A payload on an arm that is known comes out by itself, and is a body that there can be."""

from xml.etree import ElementTree

import numpy as np
import pytest

from arm_dynamics import Dynamics, load_scene
from arm_dynamics.exceptions import InvalidInput
from arm_studies.identification import JointRecord, estimate_payload, identify_payload

BODY = {
    "frame": "panda_hand", "mass": 1.2, "com": (0.01, -0.02, 0.08),
    "inertia": (0.004, 0.0005, 0.0, 0.005, 0.0, 0.003),
}  # fmt: skip


def scene(**more):
    content = load_scene("panda").model_dump(exclude_unset=True, mode="json")
    names = [f"panda_joint{i}" for i in range(1, 8)]
    rub = {"viscous": 0.5, "coulomb": 0.7}
    joints = {n: {"friction": rub, "limits": {"lower": -9, "upper": 9}} for n in names}
    return content | {"joints": joints} | more


@pytest.fixture(scope="module")
def record():
    dynamics = Dynamics(scene(payloads=[BODY]))
    t = np.arange(0.0, 12.0, 0.02)
    w = 2.0 * np.pi * np.linspace(0.25, 0.55, 7)
    q = np.sin(np.outer(t, w) + np.arange(7))
    v, a = w * np.cos(np.outer(t, w) + np.arange(7)), -(w**2) * q
    return JointRecord.of(dynamics.joint_names, t, q, dynamics.inverse(q, v, a), v, a)


def test_the_payload_comes_out(record):
    found = identify_payload(scene(), record, "panda_hand")
    assert found.mass == pytest.approx(BODY["mass"], rel=1e-6)
    np.testing.assert_allclose(found.com, BODY["com"], atol=1e-7)
    np.testing.assert_allclose(found.inertia, BODY["inertia"], atol=1e-7)


def test_it_comes_out_on_an_arm_of_point_masses():
    carried = {"frame": "bob", "mass": 0.7, "com": (0.0, 0.0, -0.1)}
    arm = load_scene("pendulum").model_dump(exclude_unset=True, mode="json")
    dynamics = Dynamics(arm | {"payloads": [carried]})
    t = np.arange(0.0, 8.0, 0.01)[:, None]
    q, v, a = np.sin(2.0 * t), 2.0 * np.cos(2.0 * t), -4.0 * np.sin(2.0 * t)
    record = JointRecord.of(dynamics.joint_names, t[:, 0], q, dynamics.inverse(q, v, a), v, a)
    found = identify_payload(arm, record, "bob")
    again = Dynamics(arm | {"payloads": [found.model_dump()]})
    np.testing.assert_allclose(again.inverse(q, v, a), record.effort, atol=1e-4)


def nearly_planar(tilt, seed):
    """An arm whose axes are parallel up to a tilt, and a noisy recording of it with a payload."""
    arm = load_scene("two_link").model_dump(exclude_unset=True, mode="json")
    root = ElementTree.fromstring(arm["robot"]["urdf"])
    root.find("joint[@name='elbow']/origin").set("rpy", f"{tilt} 0 0")
    arm["robot"]["urdf"] = ElementTree.tostring(root, encoding="unicode")
    dynamics = Dynamics(arm | {"payloads": [BODY | {"frame": "tip"}]})
    t, w, rng = np.arange(0.0, 12.0, 0.02)[:, None], [2.1, 3.3], np.random.default_rng(seed)
    q = np.sin(w * t + seed) + 0.4 * np.cos(5.0 * t)
    v = w * np.cos(w * t + seed) - 2.0 * np.sin(5.0 * t)
    a = -np.square(w) * np.sin(w * t + seed) - 10.0 * np.cos(5.0 * t)
    effort = dynamics.inverse(q, v, a) + 0.02 * rng.standard_normal(q.shape)
    return arm, JointRecord.of(dynamics.joint_names, t[:, 0], q, effort, v, a)


@pytest.mark.parametrize(("tilt", "missing"), [
    (0.0, {"com.y", *(f"inertia.{axes}" for axes in ("xx", "xy", "xz", "yz", "zz"))}),
    (0.1, {"inertia.xx", "inertia.xz", "inertia.zz"}), (0.5, set()),
])  # fmt: skip
def test_intervals_contain_the_truth_and_what_is_not_determined_is_named(tilt, missing):
    """In a plane only the inertia about its normal acts; near it, others hardly do."""
    inside = []
    for seed in range(3):
        found = estimate_payload(*nearly_planar(tilt, seed), "tip")
        true = (BODY["mass"], *BODY["com"], *BODY["inertia"])
        assert set(found.missing) == missing
        for (name, value, _), truth in zip(found.rows(), true, strict=True):
            assert name in found.intervals or name in missing
            if name not in missing:
                low, high = found.intervals[name]
                assert low < value < high and high - low < 0.02
                inside.append(low < truth < high)
    assert np.mean(inside) >= 0.85


def test_late_efforts_are_told_and_errors_of_the_arm_are_scatter():
    arm, now = nearly_planar(0.5, 0)
    q = now.q + 5e-3 * now.v + 0.5 * 5e-3**2 * now.a
    q += 1e-5 * np.random.default_rng(0).standard_normal(q.shape)
    for rub, scatter in ((0.0, set()), (0.5, {"mass"})):
        effort, told = now.effort + rub * np.sign(now.v), []
        record = JointRecord.of(now.joint_names, now.time, q, effort)
        estimate = estimate_payload(arm, record, "tip", on_note=told.append)
        assert estimate.scatter & {"mass"} == scatter
        assert scatter or any(note.startswith("efforts are 5 ±") for note in told)


@pytest.mark.parametrize(("frame", "lost", "said"), [
    ("panda_hant", [], "did you mean 'panda_hand'"),
    ("panda_link0", [], "frame 'panda_link0' does not move"),
    ("panda_hand", [6], "no effort of joint 'panda_joint7'"),
])  # fmt: skip
def test_what_says_nothing_of_a_payload_is_refused(record, frame, lost, said):
    effort = record.effort.copy()
    effort[:, lost] = np.nan
    wrong = JointRecord.of(record.joint_names, record.time, record.q, effort)
    with pytest.raises(InvalidInput, match=said):
        identify_payload(scene(), wrong, frame)
