# SPDX-License-Identifier: Apache-2.0
"""The equations of motion as expressions; each module reads like the equations in its source.

They depend on trees of links, frames and scene types, but not on a model, an arm's parameters or a
solver. Most functions accept CasADi expressions and NumPy arrays alike. The modules are public.
"""
