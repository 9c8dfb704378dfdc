# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A selection applied to tracks that are there as a whole: folders, stores."""

import re
from collections import Counter
from dataclasses import replace

import torch

from wildshape.datasets.tracks.selection import Selection
from wildshape.errors import BadInputError
from wildshape.records import Track


def filtered(track: Track, selection: Selection, rejected: Counter[str]) -> Track | None:
    """What a selection leaves of a track, if it leaves anything.

    Args:
        track: as it was read; whether its object moved is not known, for the sensor may have.
        selection: see there; empty categories are all of them.
        rejected: what is left out is counted here, by reason.
    """
    if selection.categories and track.category not in selection.categories:
        rejected[f"object: category {track.category or 'unknown'}"] += 1
        return None
    kept = []
    for i in range(0, len(track.scans), selection.every):
        objection = selection.objection_to_scan(track.scans[i])
        if objection:
            rejected[objection] += 1
        else:
            kept.append(i)
    chosen = track if len(kept) == len(track.scans) else _only(track, kept)
    objection = selection.objection_to_track(chosen, None)
    if objection:
        rejected[objection] += 1
    return None if objection else chosen


def _only(track: Track, kept: list[int]) -> Track:
    poses = track.T_sensor_object
    return replace(
        track,
        scans=tuple(track.scans[i] for i in kept),
        scan_names=tuple(track.scan_names[i] for i in kept),
        T_sensor_object=poses[torch.tensor(kept)] if poses is not None and kept else None,
    )


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
