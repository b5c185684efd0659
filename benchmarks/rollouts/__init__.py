# SPDX-License-Identifier: Apache-2.0
"""Rollouts of arms with features: what a tick costs one by one and in vector registers."""
