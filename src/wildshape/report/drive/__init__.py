# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A finished drive to look at: its scene over time, its vehicles, its picture from above.

Start with `page.py`. The script that draws the scene is `../page/template/scene.js`.
"""
