# SPDX-License-Identifier: Apache-2.0
"""Random sets of features on ordinary arms: is a wrong motion ever not told? Also by MuJoCo."""
