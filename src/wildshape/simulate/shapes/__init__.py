# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Objects to be scanned: procedural vehicles, airplanes and chairs, and the user's own meshes.

Start with `solid`, a closed triangle surface.
"""
