# SPDX-License-Identifier: Apache-2.0
"""The command line of the suite; heavy imports wait until a command needs them."""
