# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""CPU seconds of one core that each stage of `wildshape drive` takes for a second of a recording.

    python experiments/drive_stages.py RECORDING [--hz 10] [--out FOLDER]

One process with one thread. Loading the weights is not counted, importing libraries is.
"""

import argparse
import time
from collections import defaultdict
from pathlib import Path
from tempfile import TemporaryDirectory

import torch

import wildshape
from wildshape.cli.main import in_a_sentence
from wildshape.drives.config import INFERENCE
from wildshape.drives.result import DriveResult


def measure(recording: Path, out: Path) -> tuple[dict[str, float], DriveResult]:
    """CPU seconds by stage, and what was found."""
    torch.set_num_threads(1)
    predictor = wildshape.load(config=INFERENCE)
    spent: defaultdict[str, float] = defaultdict(float)
    last = time.process_time()

    def watch(stage: str, done: int, total: int) -> None:
        """What went by since the last word belongs to the stage that speaks now."""
        nonlocal last
        del done, total
        now = time.process_time()
        spent[stage] += now - last
        last = now

    found = wildshape.drive(
        recording, out, predictor=predictor, workers=1, overwrite=True, watch=watch
    )
    return dict(spent), found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--hz", type=float, default=10.0)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    with TemporaryDirectory() as folder:
        spent, found = measure(given.recording, given.out or Path(folder) / "found")
    seconds = found.frames / given.hz
    print(f"{found.frames} scans, {found.candidates} objects, {len(found.vehicles)} vehicles\n")
    print("| stage | CPU seconds |\n|---|---:|")
    for stage, cost in {**spent, "all": sum(spent.values())}.items():
        print(f"| {stage} | {cost / seconds:.2f} |")


if __name__ == "__main__":
    with in_a_sentence():
        main()
