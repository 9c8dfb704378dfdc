# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a sensor sees: its polar or image coordinates, its bins, its field of view.

Start with `visibility` (paper 4.4).
"""
