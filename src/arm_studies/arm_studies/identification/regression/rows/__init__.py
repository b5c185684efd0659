# SPDX-License-Identifier: Apache-2.0
"""The rows of a regression: measured motions, decimated, and which of their rows are used.

Depends on the columns of friction laws and of bodies, not on how these are fitted.
"""
