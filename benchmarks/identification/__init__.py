# SPDX-License-Identifier: Apache-2.0
"""How well an arm is identified: known truth under noise, and recordings of real robots."""
