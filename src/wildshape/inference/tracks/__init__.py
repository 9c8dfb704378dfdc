# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One object from all scans of its track: headings agreed, poses refined, one shape.

Start with `complete_track`.
"""
