# SPDX-License-Identifier: Apache-2.0
"""The error of every method, step and tolerance on motions that are known.

``./arm python -m benchmarks.accuracy`` measures what ``docs/laboratory/accuracy.md`` shows.
"""
