# SPDX-License-Identifier: Apache-2.0
"""One question a file, put to all simulators in the same run; each returns plain data.

``bench`` is what every study is given. The report is made in ``comparison``, which the studies do
not know; ``contact`` prints a table of its own.
"""
