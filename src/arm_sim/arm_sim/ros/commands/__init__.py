# SPDX-License-Identifier: Apache-2.0
"""Commands: merged by joints, arbitrated between sources, and valid until they are stale.

Also wrenches on frames, and stopping and holding of the arm without commands. Depends neither on
messages and topics nor on other parts of the node.
"""
