# SPDX-License-Identifier: Apache-2.0
"""One question a file; each returns plain data for the report."""
