# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What `complete` and `register` do: whole inputs completed into a folder.

Start with `complete_folder`; the network's answers themselves are made by `predictor`.
"""
