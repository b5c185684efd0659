# SPDX-License-Identifier: Apache-2.0
"""Triangular factorizations of matrices of expressions, which keep the zeros of the matrices."""
