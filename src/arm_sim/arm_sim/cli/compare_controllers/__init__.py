# SPDX-License-Identifier: Apache-2.0
"""Which controller does it best: regulation and a straight line, right and wrong models."""
