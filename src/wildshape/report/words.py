# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How many of something, in words."""


def counted(count: int, what: str) -> str:
    """For example `1 scan`, `2 scans`, `20,000 scans`."""
    return f"{count:,} {what}{'' if count == 1 else 's'}"
