# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Pages for people: the HTML report, the viewer, statistics of tracks; pictures of objects.

What all of them draw is in `content` and `scene`; `results` reads what commands left in a folder.
Start with `content`.
"""
