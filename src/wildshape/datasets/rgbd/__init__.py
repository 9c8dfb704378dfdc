# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""RGB-D frames with instance masks of any camera, and data sets in the BOP format.

Start with `reader`; `bop` for BOP.
"""
