# SPDX-License-Identifier: Apache-2.0
"""All nodes under load for a long time, with faults put in: does every one show?

``system`` runs the nodes, ``faults`` are what is done to them, ``run`` does it and gathers a
``result``; ``./arm soak``.
"""
