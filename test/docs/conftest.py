# SPDX-License-Identifier: Apache-2.0
"""Fixtures of tests of pages that talk to nodes."""

from ros_fixtures import ros, ros_environment, transports  # noqa: F401
