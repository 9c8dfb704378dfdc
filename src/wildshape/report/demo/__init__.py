# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The demo: simulate, train, evaluate, complete, register and fuse, and draw it all.

Start with `run`.
"""
