# SPDX-License-Identifier: Apache-2.0
"""Inertias, armatures and friction from torques, by least squares.

Depends on models and measured motions; neither on files nor on scenes. ``rows`` builds the
regression from motions, ``selection`` chooses friction laws, ``fit`` fits them with the bodies.
"""
