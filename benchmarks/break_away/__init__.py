# SPDX-License-Identifier: Apache-2.0
"""Break-away of joints and contacts that hold together, against linear programs.

Random sets whose reactions statics does not determine: feet, rails, loops, couplings, grasps.
``sets`` draws them, with their balance of forces written out by hand; ``limits`` finds the loads
up to which a distribution of the reactions within all static limits exists, by SciPy; ``measure``
asks the simulator and ``Dynamics``.
"""
