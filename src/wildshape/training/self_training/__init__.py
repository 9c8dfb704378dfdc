# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a network and whole tracks teach the next network, without labels (beyond the paper).

Start with `pseudo_labels`.
"""
