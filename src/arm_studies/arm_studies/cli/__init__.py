# SPDX-License-Identifier: Apache-2.0
"""Commands of the studies, and the command group of the whole suite."""
