# SPDX-License-Identifier: Apache-2.0
"""Sweeps at their full size: how fast, and is it the same table whoever makes it?"""
