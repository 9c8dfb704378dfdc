# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Pages for people: the HTML report, the viewer, pictures and statistics of tracks.

Start with `page`.
"""
