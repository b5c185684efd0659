# SPDX-License-Identifier: Apache-2.0
"""The equations of motion as expressions: each module reads like the equation in its source.

They know trees of links, frames and types of the scene, and no model, no numbers of an arm, no
solver. Most functions take CasADi expressions and NumPy arrays alike. Its modules are public.
"""
