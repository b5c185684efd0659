# SPDX-License-Identifier: Apache-2.0
"""The services of the dynamics node, one function each, and the counts of their requests.

The most frequent services run in C, without the interpreter (``compiled_services``).

Depends on the core, the interfaces and ``common``; neither on the node nor on the controller.
"""
