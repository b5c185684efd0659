# SPDX-License-Identifier: Apache-2.0
"""Recordings of running systems: every tick of a sim node, or the messages of any topics.

Depends on the engine, its topics, and the writers of recordings; a separate thread compresses and
writes.
"""
