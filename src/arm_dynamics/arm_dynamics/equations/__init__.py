# SPDX-License-Identifier: Apache-2.0
"""The equations of motion as expressions: each module reads like the equation in its source.

They depend on trees of links, frames and types of the scene, and on no model, no parameters of an
arm and no solver. Most functions take CasADi expressions and NumPy arrays alike. The modules are
public.
"""
