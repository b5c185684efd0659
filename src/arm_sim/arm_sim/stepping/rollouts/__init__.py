# SPDX-License-Identifier: Apache-2.0
"""Many arms at once: several side by side in SIMD lanes, shared among threads."""
