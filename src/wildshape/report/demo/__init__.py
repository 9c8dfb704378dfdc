# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The demo: simulate, train, evaluate, complete, register, fuse, draw it all; then a drive.

Start with `run`.
"""
