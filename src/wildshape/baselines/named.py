# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The baselines by the name of their row, with the settings that our tables use.

They are imported when one is asked for: the names alone cost nothing.
"""

from typing import TYPE_CHECKING

from wildshape.errors import BadInputError

if TYPE_CHECKING:
    from wildshape.baselines.identity import Identity, OneScan
    from wildshape.baselines.pairs import Chained
    from wildshape.baselines.rectangle import Rectangle

NAMES = (
    "identity",
    "one-scan",
    "rectangle",
    "l-shape",
    "local-icp",
    "global-icp",
    "multi-start-icp",
    "gicp",
    "kiss-matcher",
)


def baseline(name: str) -> "Identity | OneScan | Rectangle | Chained":
    """One of `NAMES`, ready to run.

    Raises:
        BadInputError: there is none of this name.
        MissingExtraError: it needs a library that is not installed; says which.
    """
    if name not in NAMES:
        raise BadInputError(f"'{name}' is no baseline; there are {', '.join(NAMES)}.")
    from wildshape.baselines.global_icp import GlobalIcp, available
    from wildshape.baselines.icp import Gicp, LocalIcp, MultiStartIcp
    from wildshape.baselines.identity import Identity, OneScan
    from wildshape.baselines.kiss_matcher import KissMatcher
    from wildshape.baselines.pairs import Chained
    from wildshape.baselines.rectangle import fitted_l_shape, smallest

    makers = {
        "identity": Identity,
        "one-scan": OneScan,
        "rectangle": smallest,
        "l-shape": fitted_l_shape,
        "local-icp": lambda: Chained(LocalIcp()),
        "global-icp": lambda: Chained(GlobalIcp(available())),
        "multi-start-icp": lambda: Chained(MultiStartIcp()),
        "gicp": lambda: Chained(Gicp()),
        "kiss-matcher": lambda: Chained(KissMatcher()),
    }
    return makers[name]()
