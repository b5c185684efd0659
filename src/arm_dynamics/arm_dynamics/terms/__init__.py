# SPDX-License-Identifier: Apache-2.0
"""One table of terms: what is asked of an arm at a state, and what follows from each entry.

``table`` states every term once; ``arm`` is what its formulas are evaluated with, ``answers``
numbers for single states and batches, ``compiled`` code, and ``verify`` its verification.

Depends on the model and its laws; on nothing that asks for terms. Import from the modules: the
table knows neither CasADi nor Pinocchio.
"""

from arm_dynamics.terms.table import TERMS, Entry

__all__ = ["TERMS", "Entry"]
