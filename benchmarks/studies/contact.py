# SPDX-License-Identifier: Apache-2.0
"""What rest on a table is worth: penetration, creep and sliding, here and in MuJoCo, same step.

A point mass of 2 kg on rails x and z touches the plane z = 0 with µ = 0.4, RK4 at 1 ms. MuJoCo
runs with its default contact and with the stiffest that this step allows (solref 2 ms), elliptic
cones. ``./arm python -m benchmarks.studies.contact`` prints the table of docs/concepts/contact.md.
"""

import mujoco
import numpy as np

from arm_sim import Simulator

MASS, MU, G, DT = 2.0, 0.4, 9.81, 1e-3
URDF = """<robot name="rails"><link name="base"/><link name="rail"/><link name="body"><inertial>
<mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="x" type="prismatic"><parent link="base"/><child link="rail"/><axis xyz="1 0 0"/>
<limit lower="-9" upper="9" effort="1e9" velocity="1e9"/></joint><joint name="z"
type="prismatic"><parent link="rail"/><child link="body"/><axis xyz="0 0 1"/>
<limit lower="-9" upper="9" effort="1e9" velocity="1e9"/></joint></robot>"""
MJCF = """<mujoco><option timestep="0.001" integrator="RK4" cone="elliptic" gravity="0 0 -9.81"/>
<default><geom friction="0.4 0 0" solref="{solref} 1"/></default><worldbody>
<geom type="plane" size="9 9 1"/><body pos="0 0 0.01"><joint type="slide" axis="1 0 0"/>
<joint type="slide" axis="0 0 1"/><geom type="sphere" size="0.01" mass="2"/></body></worldbody>
</mujoco>"""


def ours(push: float, speed: float, seconds: float) -> np.ndarray:
    contact = {"type": "contact", "frame": "body", "friction": MU}
    sim = Simulator({"robot": {"urdf": URDF}, "constraints": [contact]}, integrator="rk4", dt=DT)
    sim.reset(v=[speed, 0.0])
    return np.asarray(sim.run(seconds, [push, 0.0]).q)


def mujoco_run(solref: float, push: float, speed: float, seconds: float) -> np.ndarray:
    """The same by MuJoCo."""
    model = mujoco.MjModel.from_xml_string(MJCF.format(solref=solref))
    data = mujoco.MjData(model)
    data.qvel[0] = speed
    rows = []
    for _ in range(round(seconds / DT)):
        data.qfrc_applied[0] = push
        mujoco.mj_step(model, data)
        rows.append(data.qpos.copy())
    return np.array(rows)


def main() -> None:
    runs = {
        "here": ours,
        "MuJoCo, default": lambda *case: mujoco_run(0.02, *case),
        "MuJoCo, solref 2 ms": lambda *case: mujoco_run(0.002, *case),
    }
    stop = 0.5 / (MU * G)
    print(f"{'':22} {'inside [m]':>11} {'creep [m/s]':>12} {'error of the stop [m]':>22}")
    for name, run in runs.items():
        rest = run(0.9 * MU * MASS * G, 0.0, 4.0)
        creep = (rest[-1, 0] - rest[len(rest) // 2, 0]) / 2.0
        slid = run(0.0, 1.0, 1.0)[-1, 0]
        print(f"{name:22} {-rest[-1, 1]:11.1e} {creep:12.1e} {abs(slid - stop):22.1e}")


if __name__ == "__main__":
    main()
