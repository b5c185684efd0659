# SPDX-License-Identifier: Apache-2.0
"""Threads of a node: background work, scheduling, and privileges of those with deadlines.

Depends on the declaration of parameters only. Modules are imported one by one, as in ``common``.
"""
