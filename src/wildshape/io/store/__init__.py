# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The packed store: tracks in few large files, memory-mapped (docs/formats.md).

Start with `store` to read, `writer` to write.
"""
