# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""PandaSet: cuboids and sweeps in pickles of pandas, read without running them.

Start with `reader`.
"""
