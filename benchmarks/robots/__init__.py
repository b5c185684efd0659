# SPDX-License-Identifier: Apache-2.0
"""The robots that are measured, each as one plain URDF text that every simulator reads."""
