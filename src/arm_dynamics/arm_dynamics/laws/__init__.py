# SPDX-License-Identifier: Apache-2.0
"""The equations as CasADi expressions, each written once."""
