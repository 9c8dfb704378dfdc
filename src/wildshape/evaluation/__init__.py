# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The evaluation protocol of METHOD 8: metrics, tables, figures.

Methods are handed in. Start with `protocol`.
"""
