# SPDX-License-Identifier: Apache-2.0
"""A second simulator of scenes, written anew: NumPy, Pinocchio's own quantities and SciPy.

It shares no line with the suite: it reads a scene as plain data, takes inertia, bias forces and
Jacobians from Pinocchio, the laws from the pages of the documentation, and integrates with
``scipy.integrate.DOP853`` from one located event to the next. Which joints stick and which
contacts carry it finds by trying all possibilities, where the suite pivots. It is slow, and made
to be read.

    description  what a scene says, key by key; refuses what it does not know
    tree         inertia, bias, points of the arm, by Pinocchio
    flow, drives, bristles, springs    torques that follow from states, with their energies
    dry          friction that holds
    rows         what constrains the motion: loops, contacts, stops
    system       all of them: the rates of the state in a mode
    modes        which mode comes next; impacts
    integrate    from event to event
"""

from .integrate import Motion, simulate

__all__ = ["Motion", "simulate"]
