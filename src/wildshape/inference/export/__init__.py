# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The predictor as one graph of plain operations, for runtimes without torch.

Start with `graph`.
"""
