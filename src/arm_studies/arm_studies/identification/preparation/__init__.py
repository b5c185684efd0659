# SPDX-License-Identifier: Apache-2.0
"""Joint states as recorded become a motion at a constant rate, filtered, with accelerations.

``even_record`` has the stages in their order: ``doubtful_efforts`` are left out, gaps split the
recording into stretches, which are brought to an ``even_grid``, then filtered.
"""
