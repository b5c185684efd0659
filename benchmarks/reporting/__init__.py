# SPDX-License-Identifier: Apache-2.0
"""What all reports share: Markdown tables, the style of figures, a progress bar.

Knows nothing of what is reported.
"""
