# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Complete, register and fuse with a trained network.

Nothing here learns. Start with `predictor`.
"""
