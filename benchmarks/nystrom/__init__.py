# SPDX-License-Identifier: Apache-2.0
"""Error and cost of ``nystrom4`` beside those of ``rk4``, in the same motions and rounds."""
