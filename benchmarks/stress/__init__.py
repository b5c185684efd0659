# SPDX-License-Identifier: Apache-2.0
"""Random scenes at their worst: does anything fail without saying so?

``./arm stress``. ``scenes`` draws all of them; ``judge`` compares motions with what they should
be, ``holding`` the loads at which parts let go with the linear programs of ``limits``.
"""
