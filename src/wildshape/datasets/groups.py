# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Parts of a data set that is one long list of tracks: groups of neighbours."""

import re

from wildshape.errors import BadInputError

_LEAST, _MOST_PARTS = 32, 1000


def groups(count: int) -> list[str]:
    """Names such as `000000-000031` of groups that cover tracks 0 to `count` - 1.

    At least 32 tracks a group, so that a part is worth its files, and at most a thousand groups.
    """
    size = max(_LEAST, -(-count // _MOST_PARTS))
    return [f"{i:06d}-{min(i + size, count) - 1:06d}" for i in range(0, count, size)]


def members(group: str) -> range:
    """The tracks of a group.

    Raises:
        BadInputError: no name that `groups` gives.
    """
    found = re.fullmatch(r"(\d+)-(\d+)", group)
    if not found:
        raise BadInputError(f"part '{group}': expected two numbers such as 000000-000031.")
    return range(int(found[1]), int(found[2]) + 1)
