# SPDX-License-Identifier: Apache-2.0
"""Bodies, armatures and friction from torques, by least squares.

Knows models and measured motions at even times; neither recordings as they came nor scenes that
come out. ``rows`` makes a regression of motions, ``selection`` chooses laws of friction, ``fit``
fits them with the bodies.
"""
