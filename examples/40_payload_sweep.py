# SPDX-License-Identifier: Apache-2.0
"""Three controllers on arms with unknown payload and friction.

The same study as a file for ``./arm sweep``: examples/payload_sweep.yaml.
"""

from pathlib import Path

import numpy as np

from arm_sim.figures import figure
from arm_studies.sweeps import load_study, sweep

study = load_study(Path(__file__).with_name("payload_sweep.yaml"))
done = sweep(study, workers=1)  # workers=None: all cores
table = done.table
print(f"{len(table)} closed loops of {study.duration:g} s in {done.seconds:.1f} s")

off = np.abs(table["payloads.0.mass"] - 1.0)  # difference from the model, in [kg]
for name in ("computed_torque", "feed_forward", "pd_gravity"):
    these = table["controller"] == name
    error = 1e3 * table["tracking_max"][these]
    print(
        f"{name:16} largest error [mrad]: median {np.median(error):5.1f}, worst {error.max():5.1f}"
    )
    if name != "pd_gravity":  # controllers that rely on the model get worse with its error
        assert np.corrcoef(off[these], error)[0, 1] > 0.7

with figure("payload_sweep", size=(7, 4)) as axis:
    shown = {"computed_torque": "computed torque", "feed_forward": "feed-forward"}
    for name, words in (shown | {"pd_gravity": "PD + gravity"}).items():
        these = table["controller"] == name
        axis.scatter(
            table["payloads.0.mass"][these], 1e3 * table["tracking_max"][these], s=9, label=words
        )
    axis.axvline(1.0, color="0.5", linewidth=0.8)
    axis.set(xlabel="payload [kg]; 1 kg in the model", ylabel="largest tracking error [mrad]",
             yscale="log", title="A Panda whose payload and friction are not known")  # fmt: skip
    axis.legend()
