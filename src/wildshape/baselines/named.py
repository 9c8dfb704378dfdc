# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The baselines by the name of their row, with the settings that our tables use."""

from collections.abc import Callable

from wildshape.baselines.gicp import Gicp
from wildshape.baselines.global_icp import GlobalIcp, available
from wildshape.baselines.identity import Identity, OneScan
from wildshape.baselines.kiss_matcher import KissMatcher
from wildshape.baselines.local_icp import LocalIcp
from wildshape.baselines.multi_start_icp import MultiStartIcp
from wildshape.errors import BadInputError

Baseline = Identity | OneScan | LocalIcp | GlobalIcp | MultiStartIcp | Gicp | KissMatcher


def _global_icp() -> GlobalIcp:
    return GlobalIcp(available())


_MAKERS: dict[str, Callable[[], Baseline]] = {
    "identity": Identity,
    "one-scan": OneScan,
    "local-icp": LocalIcp,
    "global-icp": _global_icp,
    "multi-start-icp": MultiStartIcp,
    "gicp": Gicp,
    "kiss-matcher": KissMatcher,
}
NAMES = tuple(_MAKERS)


def baseline(name: str) -> Baseline:
    """One of `NAMES`, ready to run.

    Raises:
        BadInputError: there is none of this name.
        MissingExtraError: it needs a library that is not installed; says which.
    """
    if name not in _MAKERS:
        raise BadInputError(f"'{name}' is no baseline; there are {', '.join(NAMES)}.")
    return _MAKERS[name]()
