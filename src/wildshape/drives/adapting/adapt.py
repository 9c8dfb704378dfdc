# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""From finished drives to weights that suit them better, or to the reason why there are none."""

import hashlib
import json
import shutil
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from wildshape.arguments import as_path, expect
from wildshape.drives.adapting.config import AdaptConfig
from wildshape.drives.adapting.examples import Example, examples_of, split
from wildshape.drives.adapting.fine_tuning import taught
from wildshape.drives.adapting.measures import Measures, clear_headed, measure
from wildshape.drives.adapting.second_pass import like
from wildshape.drives.clock import Watch, silent
from wildshape.drives.result import identity_of
from wildshape.errors import BadInputError
from wildshape.inference.predictor import Predictor
from wildshape.io.atomic import atomic_write, write_json
from wildshape.io.guard import read_json, read_record, reading, record_of
from wildshape.io.output import MARKER, begin, finished, is_begun
from wildshape.io.progress import counted, duration
from wildshape.method.checkpoint import MODEL

ADAPTED, SAID = "adapted", "adapted.json"
_COMMAND, _SAYS = "drive --adapt", "what `wildshape drive` says of itself"


@dataclass(frozen=True)
class Adaptation:
    """What came of an adaptation.

    Attributes:
        model: the adapted checkpoint, if it is kept: better on tracks held out.
        trained: tracks trained on.
        held_out: tracks measured on.
        unclear: tracks left out, for it is not clear which way they look.
        steps: of the training; 0 if there were too few tracks.
        before: measures of the first model.
        after: of the adapted one.
        worse: in what it is worse, in words.
        seconds: that it took, of the run that ended it.
    """

    model: str | None
    trained: int
    held_out: int
    unclear: int
    steps: int = 0
    before: Measures | None = None
    after: Measures | None = None
    worse: tuple[str, ...] = ()
    seconds: float = 0.0

    @property
    def sentence(self) -> str:
        """The same in words."""
        if self.before is None or self.after is None:
            clear, unclear = counted(self.trained, "vehicle track"), f"{self.unclear} unclear"
            return (
                f"not adapted: {clear} to learn from ({unclear}) are too few; what was found stays"
            )
        if self.worse:
            end = f"not kept, for {' and '.join(self.worse)}; what was found stays"
        else:
            end = f"kept; the weights are {self.model}"
        return (
            f"adapted on {counted(self.trained, 'track')} in {counted(self.steps, 'step')}"
            f" ({duration(self.seconds)}); on {self.held_out} held out"
            f" {_change(self.before, self.after)}: {end}"
        )

    @property
    def data(self) -> dict[str, Any]:
        """The same as JSON values."""
        return {"sentence": self.sentence, "kept": self.model is not None, **asdict(self)}


def _change(before: Measures, after: Measures) -> str:
    sides = zip(("length", "width", "height"), before.spread_m, after.spread_m)
    spread = ", ".join(f"{name} {was:.3f} to {now:.3f} m" for name, was, now in sides)
    return (
        f"the cost went from {before.cost_m:.4f} to {after.cost_m:.4f} m, the spread of sizes along"
        f" a track: {spread}, scans that look as their track from {100 * before.headings:.1f} to"
        f" {100 * after.headings:.1f} %"
    )


def adapt_to(
    outs: Sequence[Path | str],
    folder: Path | str,
    predictor: Predictor,
    config: AdaptConfig,
    *,
    overwrite: bool = False,
    watch: Watch = silent,
) -> Adaptation:
    """Train a model on the vehicles of finished drives, and see on some of them if it is better.

    Writes `adapted.json` and the folder `adapted`. An interrupted run is gone on with; a finished
    one is read.

    Args:
        outs: folders of the drives, with what the model found.
        folder: to write into.
        predictor: of the model.
        config: see there.
        overwrite: remove an earlier adaptation first.
        watch: told of progress.

    Raises:
        BadInputError: a drive's folder is damaged, or another adaptation is there.
    """
    if isinstance(outs, str | Path):
        raise BadInputError(f"outs: expected a list of folders, found '{outs}'; put it in a list.")
    outs = [as_path(out, "outs") for out in outs]
    expect(predictor, Predictor, "predictor", "wildshape.load gives one")
    expect(config, AdaptConfig, "config")
    folder = as_path(folder, "folder")
    place = folder / ADAPTED
    settings = {
        "drives": {str(out.resolve()): _hash_of(out) for out in outs},
        **identity_of(predictor),
        "adapt": asdict(config),
    }
    done = None if overwrite else finished(place, _COMMAND, settings, parts=())
    if done is not None:
        with reading(place / MARKER, "what an adaptation says of itself"):
            found = record_of(Adaptation, done["result"], {})
        if found.model is None or (place / MODEL).is_file():
            return replace(found, model=found.model and _weights_in(place))
        write_json(place / MARKER, {**done, "status": "running"})  # its weights were removed
    if (
        not overwrite
        and is_begun(place)
        and _settings_of(place) != json.loads(json.dumps(settings))
    ):
        raise BadInputError(
            f"{place}: an adaptation of other drives or settings is there; remove this folder to"
            " adapt anew, what was found in the drives stays."
        )
    output = begin(place, _COMMAND, settings, ("**/*",), overwrite=overwrite)
    with output.abandoned_if_refused():
        found = _Adapting(outs, place, predictor, config, watch).perform()
    write_json(folder / SAID, found.data)
    output.finish(result=asdict(found))
    return found


def _weights_in(folder: Path) -> str:
    """Of an adaptation; absolute, for other machines work elsewhere."""
    return str((folder / MODEL).resolve())


def _settings_of(folder: Path) -> Any:
    with reading(folder / MARKER, _SAYS):
        return read_json(folder / MARKER, _SAYS, dict)["settings"]


def _hash_of(out: Path) -> str:
    """Of what decided a drive's result."""
    return hashlib.sha256(json.dumps(_settings_of(out), sort_keys=True).encode()).hexdigest()[:16]


@dataclass(frozen=True)
class _Adapting:
    """One adaptation on its way; what is in its folder is not done again."""

    outs: Sequence[Path]
    folder: Path
    predictor: Predictor
    config: AdaptConfig
    watch: Watch

    def perform(self) -> Adaptation:
        began = time.monotonic()
        config = self.config
        seen = examples_of(self.outs, config)
        clear = self.clear(seen)
        unclear = len(seen) - len(clear)
        if len(clear) < config.fewest_held + config.fewest_trained:
            return Adaptation(None, len(clear), 0, unclear)
        trained, held = split(clear, config)
        before = self.measured("before", self.predictor, held)
        candidate = taught(self.predictor, trained, self.folder, config, self.watch)
        adapted = like(self.predictor, candidate)
        after = self.measured("after", adapted, held)
        worse = after.worse_than(before)
        model = None if worse else self.folder / MODEL
        if model is not None:
            with candidate.open("rb") as made, atomic_write(model, flush=True) as file:
                shutil.copyfileobj(made, file)
        return Adaptation(
            None if model is None else _weights_in(self.folder),
            len(trained),
            len(held),
            unclear,
            config.steps,
            before,
            after,
            worse,
            round(time.monotonic() - began, 3),
        )

    def clear(self, examples: list[Example]) -> list[Example]:
        """Those of which it is clear which way they look."""
        path = self.folder / "clear.json"
        if not path.is_file():
            at = partial(self.told, "headings", len(examples))
            kept = clear_headed(self.predictor, examples, self.config, at)
            write_json(path, [one.name for one in kept])
        names = set(map(str, read_json(path, "names of tracks", list)))
        return [one for one in examples if one.name in names]

    def measured(self, when: str, predictor: Predictor, held: list[Example]) -> Measures:
        path = self.folder / f"{when}.json"
        if not path.is_file():
            at = partial(self.told, f"measuring {when}", len(held))
            write_json(path, asdict(measure(predictor, held, self.config, at)))
        return read_record(path, "an adaptation's measures", Measures)

    def told(self, stage: str, total: int, done: int) -> None:
        self.watch(stage, done, total)
