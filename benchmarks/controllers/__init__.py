# SPDX-License-Identifier: Apache-2.0
"""Nine controllers on two arms, regulation and a straight line, with right and wrong models."""
