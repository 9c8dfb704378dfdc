# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a command reads: tracks one at a time, or a scan from a pipe.

Start with `tracks`.
"""
