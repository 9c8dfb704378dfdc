# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""ShapeNet renders in the layout of DPC.

Start with `reader`.
"""
