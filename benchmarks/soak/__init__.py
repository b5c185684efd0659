# SPDX-License-Identifier: Apache-2.0
"""The whole suite under load for a long time, with faults put in."""
