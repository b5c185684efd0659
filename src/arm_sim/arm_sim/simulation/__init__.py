# SPDX-License-Identifier: Apache-2.0
"""A simulated arm, and loops over it."""
