# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Published data sets as they lie on disk become tracks, a folder for each.

Our own formats are in `io`, batches for training in `training.batches`. Start with `tracks.source`.
"""
