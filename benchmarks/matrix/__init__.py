# SPDX-License-Identifier: Apache-2.0
"""Every pair of features in one scene, against an independent solution: ``page`` and its command.

``measure`` runs one set and compares it; ``page`` writes the table; ``cli`` is the command. The
solutions are those of test/reference/make_features_together.py.
"""
