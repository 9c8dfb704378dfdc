# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape demo`: the whole way in five minutes, ending in one HTML page."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import arg

from wildshape.cli.options import AT_ORIGIN, AsJson, Origin, Overwrite, Unit, option

if TYPE_CHECKING:
    from wildshape.inference.predictor import Predictor

EXAMPLES = (
    "wildshape demo --out demo",
    "wildshape demo --out demo --data mytracks",
    "wildshape demo --out long --preset default --seconds 1800",
)
FILES = ("report.html", *(f"{d}/**/*" for d in ("data", "run", "evaluation", "completed", "fused")))

OutFolder = Annotated[Path, arg(metavar="DIR", help="folder to write")]
OwnData = Annotated[
    Path | None, option(metavar="DIR", help="your own track folders instead of simulated ones")
]


@dataclass(frozen=True)
class Settings:
    """Simulate, train, evaluate, complete, register, fuse, and draw it all in DIR/report.html.

    Attributes:
        seconds: for training; the rest takes about two minutes more.
        tracks: simulated to train on.
        test_tracks: never trained on, to look at and to measure.
        preset: what is trained.
    """

    out: OutFolder = Path("demo")
    data: OwnData = None
    seconds: Annotated[float, arg(metavar="S")] = 165.0
    tracks: Annotated[int, arg(metavar="N")] = 200
    test_tracks: Annotated[int, arg(metavar="N")] = 12
    preset: Literal["small", "default", "tiny"] = "small"
    unit: Unit = "m"
    origin: Origin = AT_ORIGIN
    overwrite: Overwrite = False
    json: AsJson = False


class Agenda:
    """Says what is being done, how long it took so far and what is left, roughly."""

    def __init__(self, seconds: float) -> None:
        self.began = time.monotonic()
        self.left = {
            "making tracks": 12.0,
            "training": seconds + 5,
            "evaluating": 45.0,
            "completing, registering and fusing unseen scans": 25.0,
            "drawing the report": 15.0,
        }

    def next(self, detail: str = "") -> None:
        """Announce the next part."""
        from wildshape.cli.terminal import duration, say

        name, left = next(iter(self.left)), sum(self.left.values())
        del self.left[name]
        say(f"[{duration(self.seconds)}] {name}{detail}; about {duration(left)} left in all")

    @property
    def seconds(self) -> float:
        """Since the beginning."""
        return time.monotonic() - self.began


def run(settings: Settings) -> None:
    """The whole way.

    Raises:
        BadInputError: the user's data cannot be used, or a demo is there already.
    """
    from wildshape.cli.demo.results import draw, evaluate, process, verdict
    from wildshape.cli.demo.tracks import Wanted, prepare
    from wildshape.cli.output import begin, unfinished
    from wildshape.cli.terminal import answer
    from wildshape.io.scans.points import Coordinates

    agenda = Agenda(settings.seconds)
    overwrite = settings.overwrite or unfinished(settings.out, "demo")
    output = begin(settings.out, "demo", {}, FILES, overwrite=overwrite)
    agenda.next()
    coordinates = Coordinates(settings.unit, settings.origin)
    data = prepare(
        Wanted(settings.out, settings.data, coordinates, settings.tracks, settings.test_tracks)
    )
    agenda.next(f" on {data.described}")
    models = {f"{settings.preset}, just trained": train(settings)}
    models |= shipped()
    agenda.next(f" on {data.tested}")
    results = evaluate(settings.out, models)
    agenda.next()
    shown = process(settings.out, models, results)
    agenda.next()
    judged = verdict(results, list(models))
    page = draw(settings.out, output, data, shown, results, judged, agenda.seconds)
    output.finish(seconds=round(agenda.seconds, 1))
    answer(
        "\n".join((*judged, f"the report is {page}")), _json(page, judged), as_json=settings.json
    )


def _json(page: Path, judged: list[str]) -> dict[str, object]:
    return {"report": str(page), "verdict": judged}


def train(settings: Settings) -> "Predictor":
    """Train for the time given; the run lies in `run/`."""
    from wildshape.cli.demo.tracks import TRAIN
    from wildshape.cli.models import choose_device
    from wildshape.cli.output import command_line
    from wildshape.cli.training.recipe import fit_with_progress, recipe_for
    from wildshape.inference.predictor import load
    from wildshape.io.provenance import provenance
    from wildshape.io.store.store import open_store
    from wildshape.training.loop import setup
    from wildshape.training.time_budget import TimeBudget

    store = open_store(settings.out / TRAIN)
    recipe = recipe_for(store, settings.preset, None)
    device = choose_device("auto")
    made = provenance(command_line())
    run = setup(recipe, store, settings.out / "run", device=device, provenance=made)
    budget = TimeBudget(settings.seconds)
    return load(fit_with_progress(run, resume=command_line(), adjust=budget.adjust), device)


def shipped() -> "dict[str, Predictor]":
    """The shipped weights, if this checkout has them."""
    from wildshape.cli.terminal import say
    from wildshape.inference.predictor import load
    from wildshape.inference.shipped_weights import SHIPPED

    if not SHIPPED.is_file():
        say("no weights are shipped with this version; the demo goes on with its own alone")
        return {}
    return {"shipped weights": load()}
