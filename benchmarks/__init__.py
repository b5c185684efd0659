# SPDX-License-Identifier: Apache-2.0
"""Everything that is measured, in folders by subject; each can be run by itself.

``comparison`` (``./arm bench``) sets run time against error, here and in other simulators, and is
made of ``studies``; all others have commands of their own. Below them are ``reference``,
``peers``, ``robots``, ``measurement`` and ``reporting``, which know none of those above.
"""
