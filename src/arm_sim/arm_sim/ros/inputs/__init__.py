# SPDX-License-Identifier: Apache-2.0
"""What a sim hears from others: commands and wrenches, and publishers of the same joint states.

``inputs`` checks them and passes them to the engine, which does not know this folder.
"""
