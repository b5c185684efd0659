# SPDX-License-Identifier: Apache-2.0
"""``./arm call``: the services of running nodes, without the ros2 command line."""

from __future__ import annotations

import click

from arm_sim.cli.call import orders, questions
from arm_sim.cli.output import examples


@click.group(
    epilog=examples(
        './arm call inverse-dynamics --position "0 -0.8 0 -2.4 0 1.6 0.8"',
        './arm call inverse-dynamics --position "panda_joint4=-2.4" --terms gravity',
        "./arm call model-info --json",
    )
)
def call() -> None:
    """Call a service of a running node.

    Vectors are in the model's order, or by joint name; joints that are not named are zero. Start
    nodes by ./arm dynamics SCENE and ./arm sim SCENE.
    """


for command in (
    questions.inverse_dynamics,
    questions.forward_dynamics,
    questions.dynamics_terms,
    questions.task_space,
    questions.inverse_kinematics,
    questions.constrained_dynamics,
    questions.model_info,
    orders.reset,
    orders.pause,
    orders.resume,
    orders.step,
    orders.set_joint_state,
    orders.set_payload,
    orders.set_friction,
    orders.reset_counters,
):
    call.add_command(command)
