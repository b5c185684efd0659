# SPDX-License-Identifier: Apache-2.0
"""Crocoddyl's side, for a Python in which it is installed; it needs nothing of this suite.

Reads a problem in a line of JSON, then the name of a solver in each line, solves, and answers with
processor time and cost in a line of JSON.
"""

import json
import sys
import time

import crocoddyl
import numpy as np
import pinocchio


def shooting_problem(said):
    """The rigid arm with one derivative a node, integrated by Crocoddyl's Euler."""
    model = pinocchio.buildModelFromXML(said["urdf"])
    state = crocoddyl.StateMultibody(model)
    actuation, w = crocoddyl.ActuationModelFull(state), said["weights"]
    weights = np.repeat([w["position"], w["velocity"]], model.nv)

    def action(scale, dt):
        costs = crocoddyl.CostModelSum(state)
        errors = crocoddyl.ResidualModelState(state, np.array(said["goal"]), model.nv)
        squares = crocoddyl.ActivationModelWeightedQuad(scale * weights)
        costs.addCost("state", crocoddyl.CostModelResidual(state, squares, errors), 1.0)
        if dt:
            efforts = crocoddyl.CostModelResidual(state, crocoddyl.ResidualModelControl(state))
            costs.addCost("effort", efforts, w["effort"])
        free = crocoddyl.DifferentialActionModelFreeFwdDynamics(state, actuation, costs)
        made = crocoddyl.IntegratedActionModelEuler(free, dt)
        made.u_lb, made.u_ub = -np.array(said["limit"]), np.array(said["limit"])
        return made

    x0 = np.concatenate([said["q0"], np.zeros(model.nv)])
    nodes = len(said["guess"])
    running = [action(1.0, said["dt"]) for _ in range(nodes)]
    return crocoddyl.ShootingProblem(x0, running, action(w["last"], 0.0))


def main():
    """Answer until there is no more to read."""
    said = json.loads(sys.stdin.readline())
    problem = shooting_problem(said)
    problem.nthreads = 1
    guess = [np.array(u) for u in said["guess"]]
    first = problem.calc(problem.rollout(guess), guess)
    if not np.isfinite(first):
        sys.exit("an arm that is held falls: this Crocoddyl was built for another Pinocchio")
    for line in sys.stdin:
        solver = getattr(crocoddyl, line.strip())(problem)
        solver.th_stop = 1e-300
        begin = time.process_time()
        xs = problem.rollout(guess)
        solver.solve(xs, guess, said["iterations"], True)
        seconds = time.process_time() - begin
        answer = {"seconds": seconds / max(1, solver.iter), "first": first, "cost": solver.cost,
                  "iterations": solver.iter, "version": crocoddyl.__version__}  # fmt: skip
        print(json.dumps(answer), flush=True)


main()
