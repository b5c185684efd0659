# SPDX-License-Identifier: Apache-2.0
"""What recording costs a running simulator, and whether a long recording comes out again.

Starts processes of the suite and looks at them from outside. Public is the command in ``cli``.
"""
