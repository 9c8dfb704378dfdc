# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One file a command: its `Settings`, `run` and `EXAMPLE`.

Start with `complete`.
"""
