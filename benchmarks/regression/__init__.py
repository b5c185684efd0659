# SPDX-License-Identifier: Apache-2.0
"""Is anything slower than it was? This tree beside an older revision, in pairs, in one run.

``./arm python -m benchmarks.regression.paired REVISION``. ``lines`` is what is timed, ``recorder``
times it in either tree and so uses nothing but the public interface.
"""
