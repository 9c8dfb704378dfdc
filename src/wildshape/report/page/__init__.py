# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The HTML report: one file that needs no network.

Start with `folder`, which says what is shown; `html` draws it.
"""
