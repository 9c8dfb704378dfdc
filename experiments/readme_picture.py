# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The README's picture: the first three simulated cars of a seed, by the shipped weights.

python experiments/readme_picture.py docs/picture.webp
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from wildshape.cli.main import in_a_sentence
from wildshape.inference.predictor import load
from wildshape.report.content import track_object
from wildshape.report.picture import write_picture
from wildshape.simulate.generate import SimulationConfig, simulate_tracks


@dataclass(frozen=True)
class Settings:
    """Draw simulated cars that no training has seen.

    Attributes:
        out: .webp or .png.
    """

    out: Annotated[Path, tyro.conf.Positional]


def main(settings: Settings) -> None:
    model = load()
    objects = []
    for track in simulate_tracks(SimulationConfig(tracks=3), seed=77):
        done = model.complete(track.scans[track.middle], track.sensor)
        T_middle_scan = model.register_track(track.scans, track.sensor)
        objects.append(
            track_object(
                track, completed=done.points, box=done.box, fused={"fused by us": T_middle_scan}
            )
        )
    write_picture(objects, settings.out)


if __name__ == "__main__":
    with in_a_sentence():
        main(tyro.cli(Settings))
