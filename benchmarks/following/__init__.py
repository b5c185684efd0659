# SPDX-License-Identifier: Apache-2.0
"""Do all goals of a client that behaves like MoveIt's controller manager end as expected?

It uses only the topics and the action of the nodes.
"""
