# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The command line: parsing, calling, printing.

One file a command is in `commands`. Start with `main`.
"""
