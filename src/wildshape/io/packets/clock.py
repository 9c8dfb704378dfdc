# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The clock of turns, a recorder's or a sensor's own, where it was set amid the recording."""

import numpy as np

_HOUR_S, _NEAR_S = 3600.0, 1.0
_SET_S = 10.0  # less is a pause of the network
_GOES_ON = 5.0  # usual steps; a pause ends so soon after whole hours once in thousands


def gone_on(stamps: list[float], micros: list[int]) -> tuple[tuple[float, ...], float]:
    """Times of turns that go on where a clock was set, and by how much it was in all, seconds.

    A leap ahead is a pause of the recording unless the other clock, of which only what is past
    the hour counts, does not show one: it goes on at the usual pace, or tells of a shorter pause.
    Times that rise less often than not stay as they are.

    Args:
        stamps: of each turn by the recorder's or the sensor's clock, seconds.
        micros: the other clock then, microseconds.
    """
    steps = np.diff(stamps)
    falls = steps <= 0
    if not len(steps) or falls.mean() > 0.5:
        return tuple(stamps), 0.0
    own = np.diff(micros) / 1e6 % _HOUR_S
    ahead = steps - own
    whole_hours = np.abs(ahead - np.rint(ahead / _HOUR_S) * _HOUR_S) < _NEAR_S
    goes_on = own < _GOES_ON * np.median(steps)
    leaps = (ahead > _SET_S) & (own > 0) & (goes_on | ~whole_hours)
    usual = float(np.median(steps[~falls & ~leaps])) if (~falls & ~leaps).any() else 0.0
    by = np.where(falls, steps - usual, np.where(leaps, ahead, 0.0))
    if not by.any():
        return tuple(stamps), 0.0
    later = np.concatenate(([0.0], np.cumsum(by)))
    return tuple((np.array(stamps) - later).tolist()), float(by.sum())


def set_told(clock: str, by_s: float) -> list[str]:
    """A sentence if a clock was set."""
    if not by_s:
        return []
    return [
        f"{clock} was set {'ahead' if by_s > 0 else 'back'} by {abs(by_s):.2g} s; later turns are"
        " taken to have gone on at the usual pace"
    ]
