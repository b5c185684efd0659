# SPDX-License-Identifier: Apache-2.0
"""What one call of ``Dynamics`` for one state takes, beside Pinocchio called directly."""
