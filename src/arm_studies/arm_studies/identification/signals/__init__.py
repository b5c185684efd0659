# SPDX-License-Identifier: Apache-2.0
"""Zero-phase filters of measured signals, their cutoff, and decimation."""
