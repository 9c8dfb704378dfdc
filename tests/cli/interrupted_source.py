# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A data set of four parts, the second of which waits for ever the first time it is read."""

import os
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from wildshape.io.atomic import write_text
from wildshape.records import Track


@dataclass
class Waiting:
    """Two tracks a part; `attempts` in `root` tells which parts were begun, `pid` who waits."""

    root: Path
    rejected: dict[str, int] = field(default_factory=Counter, init=False)

    def parts(self) -> list[str]:
        return list("abcd")

    def tracks_of(self, part: str) -> Iterator[Track]:
        with (self.root / "attempts").open("a") as file:
            file.write(f"{part}\n")
        for i in range(2):
            points = np.random.default_rng(i).normal(size=(3, 200, 3)).astype(np.float32)
            yield Track(f"{part}{i}", tuple(points), ("0", "1", "2"))
            if part == "b" and not (self.root / "pid").exists():
                write_text(self.root / "pid", str(os.getpid()))
                time.sleep(1000)
