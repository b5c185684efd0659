# SPDX-License-Identifier: Apache-2.0
"""Run by ``startup.py`` in a fresh process: time each part of a start and print it as JSON."""

import json
import os
import sys
import time

began = time.perf_counter()
import numpy as np  # noqa: E402

from arm_dynamics import load_scene  # noqa: E402
from arm_sim import Simulator  # noqa: E402

marks = [time.perf_counter()]
worked = sum(os.times()[:4])  # of this process and of the compiler that it waits for
scene = load_scene(sys.argv[1])
marks.append(time.perf_counter())
simulator = Simulator(scene, integrator=sys.argv[2], dt=1e-3)
marks.append(time.perf_counter())
simulator.step(np.zeros(simulator.n))
marks.append(time.perf_counter())

parts = dict(zip(("load_scene", "Simulator", "first step"), np.diff(marks), strict=True))
worked = sum(os.times()[:4]) - worked
total = {
    "processor": worked,
    "imports": marks[0] - began,
    "total without imports": marks[-1] - marks[0],
}
print(json.dumps(total | parts))
