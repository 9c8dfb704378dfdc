# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The baselines by the name of their row, with the settings that our tables use.

Each is imported when it is asked for: their names cost nothing.
"""

from typing import TYPE_CHECKING

from wildshape.errors import BadInputError

if TYPE_CHECKING:
    from wildshape.baselines.identity import Identity, OneScan
    from wildshape.baselines.pairs import Chained, Pair


def _chained(pair: "Pair") -> "Chained":
    from wildshape.baselines.pairs import Chained

    return Chained(pair)


def _identity() -> "Identity":
    from wildshape.baselines.identity import Identity

    return Identity()


def _one_scan() -> "OneScan":
    from wildshape.baselines.identity import OneScan

    return OneScan()


def _local_icp() -> "Chained":
    from wildshape.baselines.icp import LocalIcp

    return _chained(LocalIcp())


def _global_icp() -> "Chained":
    from wildshape.baselines.global_icp import GlobalIcp, available

    return _chained(GlobalIcp(available()))


def _multi_start_icp() -> "Chained":
    from wildshape.baselines.icp import MultiStartIcp

    return _chained(MultiStartIcp())


def _gicp() -> "Chained":
    from wildshape.baselines.icp import Gicp

    return _chained(Gicp())


def _kiss_matcher() -> "Chained":
    from wildshape.baselines.kiss_matcher import KissMatcher

    return _chained(KissMatcher())


_MAKERS = {
    "identity": _identity,
    "one-scan": _one_scan,
    "local-icp": _local_icp,
    "global-icp": _global_icp,
    "multi-start-icp": _multi_start_icp,
    "gicp": _gicp,
    "kiss-matcher": _kiss_matcher,
}
NAMES = tuple(_MAKERS)


def baseline(name: str) -> "Identity | OneScan | Chained":
    """One of `NAMES`, ready to run.

    Raises:
        BadInputError: there is none of this name.
        MissingExtraError: it needs a library that is not installed; says which.
    """
    if name not in _MAKERS:
        raise BadInputError(f"'{name}' is no baseline; there are {', '.join(NAMES)}.")
    return _MAKERS[name]()
