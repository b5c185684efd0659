# SPDX-License-Identifier: Apache-2.0
"""Commands on their way in: read and checked, arbitrated between sources, and the latest kept.

``arbiter`` and ``latest`` know no ROS; ``input`` connects them to topics.
"""
