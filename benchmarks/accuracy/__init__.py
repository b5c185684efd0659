# SPDX-License-Identifier: Apache-2.0
"""Error of every method and step on problems whose motion is known; see docs/accuracy.md."""
