# SPDX-License-Identifier: Apache-2.0
"""One table of terms: the functions of an arm's state, and what follows from each entry.

``table`` states every term once, with ``formulas``; ``arm`` is what these are evaluated with,
``answers`` numbers for single states and batches, ``compiled`` code, and ``verify`` its
verification, with a ``comparison`` for each.

Depends on the model and its laws; on nothing that asks for terms. Import from the modules: the
table knows neither CasADi nor Pinocchio.
"""

from arm_dynamics.terms.table import TERMS, Entry

__all__ = ["TERMS", "Entry"]
