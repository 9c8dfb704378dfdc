# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The figures of the shipped weights: simulated drives that no training saw, and real cars.

python -m experiments.shipped_weights --cad CAD --kitti KITTI --out OUT

writes OUT/shipped-weights.md. Stopped, the same command goes on with what was not measured yet,
or with other weights; the page names every commit that measured a part of it.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from experiments.mesh_credits import rows_of
from experiments.tables.command import begin, commit

from experiments import by_kind
from wildshape.cli.main import main
from wildshape.cli.terminal import say
from wildshape.evaluation.summary import FIGURES
from wildshape.evaluation.tables import COUNTED, cell, pipe_table
from wildshape.io.atomic import write_text
from wildshape.io.store.store import is_finished_store
from wildshape.method.checkpoint import fingerprint

PAGE = "shipped-weights.md"
_VEHICLES = ("car", "truck", "bus")
_MOST_SCANS = "8"
_AS_RECORDED = ("--baselines", "identity,one-scan,local-icp", "--track")
_TURNED = {
    turned: ("--baselines", "none", "--rotate", turned, "--seeds", "3") for turned in ("yaw", "so3")
}
_WHOLE = {
    "none": _AS_RECORDED,
    **_TURNED,
    "raw": ("--baselines", "none", "--raw"),
}
_CALLED = {
    "none": "",
    "yaw": ", turned in yaw",
    "so3": ", turned freely",
    "raw": ", not refined",
}
_SHOWN = {
    "cd", "precision", "coverage", "cd_partial", "cd_floor", "acc30", "acc30_sym", "rot_median_deg",
    "trans_median_m", "box_iou", "box_bev", "heading30",
}  # fmt: skip


@dataclass(frozen=True)
class Settings:
    """What is measured.

    Attributes:
        out: folder of data, evaluations and the page.
        cad: folder of CAD meshes with a manifest; without it these vehicles are left out.
        kitti: KITTI raw, the folder above the dates; without it real cars are left out.
        share: of the drives, for a trial in a folder of its own.
    """

    out: Path
    cad: Path | None = None
    kitti: Path | None = None
    share: float = 1.0


@dataclass(frozen=True)
class Drives:
    """A data set, and how it is measured.

    Attributes:
        name: of its folder.
        title: on the page.
        made: words of the command that makes it, but for where.
        measured: words of the evaluations, by protocol.
        kinds: whether the page tells kinds of vehicle apart.
    """

    name: str
    title: str
    made: tuple[str, ...]
    measured: dict[str, tuple[str, ...]]
    kinds: bool = False


def drives(settings: Settings) -> Iterator[Drives]:
    """All data sets, in the order of the page."""

    def simulated(tracks: int, seed: int, *words: str) -> tuple[str, ...]:
        count = max(1, round(settings.share * tracks))
        return ("simulate", "--tracks", str(count), "--seed", str(seed), *words)

    one_sensor = {"yaw": ("--baselines", "one-scan", "--rotate", "yaw", "--track")}
    few = {"none": ("--baselines", "none", "--track")}
    yield Drives(
        "procedural", "Procedural vehicles, HDL-64E, seed 9001", simulated(30, 9001), _WHOLE, True
    )
    yield Drives(
        "more", "More of them, seed 9031", simulated(150, 9031), {**few, **_TURNED}, kinds=True
    )
    yield Drives("still-more", "And more, seed 9021", simulated(150, 9021), few)
    if settings.cad is not None:
        meshes = str(_test_meshes(settings.cad, settings.out / "meshes"))
        made = simulated(168, 9002, "--scans", "12", "--meshes", meshes)
        yield Drives("cad", "CAD vehicles of split test, HDL-64E, seed 9002", made, _WHOLE, True)
    if settings.kitti is not None:
        made = ("convert", "kitti-raw", str(settings.kitti), "--every", "2")
        yield Drives("kitti", "Real cars: KITTI raw 2011_09_26_0001", made, _WHOLE)
    for name, seed in (("hdl32", 9011), ("os1-128", 9012)):
        made = simulated(30, seed, "--sensor", name)
        yield Drives(name, f"Procedural vehicles, {name}, seed {seed}", made, one_sensor)


def _test_meshes(cad: Path, into: Path) -> Path:
    """Links to the vehicles of split test, their names begun by their kind."""
    into.mkdir(parents=True, exist_ok=True)
    for row in rows_of(cad, "test"):
        link = into / f"{row['category']}_{Path(row['file']).name}"
        if row["category"] in _VEHICLES and not link.is_symlink():
            link.symlink_to((cad / row["file"]).resolve())
    return into


def run(settings: Settings, command: str) -> None:
    """Make the data, measure them, write the page."""
    out = settings.out if settings.share == 1 else settings.out / f"share-{settings.share:g}"
    done = []
    for data in drives(replace(settings, out=out)):
        store = out / data.name
        if not is_finished_store(store):
            _make(data, store)
        for protocol, words in data.measured.items():
            if not _finished(_evaluation(store, protocol)):
                said = ("--out", str(_evaluation(store, protocol)), "--max-scans", _MOST_SCANS)
                main(["evaluate", str(store), *said, *words, "--overwrite"])
        done.append(data)
        write_text(out / PAGE, page(out, done, command))
    say(f"see {out / PAGE}")


def _make(data: Drives, store: Path) -> None:
    """Its track store; `convert` names its output last."""
    command, *words = data.made
    places = (*words[:2], str(store), *words[2:]) if command == "convert" else (str(store), *words)
    main([command, *places, "--overwrite"])


def _evaluation(store: Path, protocol: str) -> Path:
    return store.with_name(f"{store.name}-{protocol}")


def _finished(folder: Path) -> bool:
    """Whether it holds figures of the weights that the package ships now."""
    path = folder / "wildshape.json"
    if not path.is_file():
        return False
    record = json.loads(path.read_text("utf-8"))
    return record["status"] == "finished" and record["settings"]["models"] == [fingerprint(None)]


def page(out: Path, done: list[Drives], command: str) -> str:
    """The tables of what is finished."""
    found = [_metrics(out / data.name, way)["provenance"] for data in done for way in data.measured]
    made = {
        f"commit {commit(one['code'])}, {one['time_utc'][:10]}, {one['hardware']['cpu']}"
        for one in found
    }
    head = (
        f"# The shipped weights: the tables\n\n```text\n{command}\n```\n\n"
        f"Measured at {'; '.join(sorted(made))}. At most"
        f' {_MOST_SCANS} scans a track are measured. "track" completes all scans of a track'
        ' together; "sym" forgives a half turn; `±` is over the seeds of the turns; boxes are of'
        " the body. [What they say](../shipped-weights.md)."
    )
    return "\n\n".join([head, *(_section(out, data) for data in done)]) + "\n"


def _section(out: Path, data: Drives) -> str:
    measured = [
        (f"{name}{_CALLED[protocol]}", found)
        for protocol in data.measured
        for name, found in _metrics(out / data.name, protocol)["methods"].items()
    ]
    known = {name for _, found in measured for name in _SHOWN if found.get(name) is not None}
    figures = [one for one in FIGURES if one.name in known]
    rows = []
    for name, found in measured:
        cells = [cell(found[f.name], found["std"][f.name], f) for f in figures]
        scans = "{completion} / {registration}".format(**found["scans_counted"])
        rows.append([name, *cells, scans])
    parts = [
        f"## {data.title}",
        pipe_table(["method", *(figure.heading for figure in figures), COUNTED], rows),
    ]
    if data.kinds:
        found = by_kind.table(out / data.name, _evaluation(out / data.name, "none"))
        parts += ["By kind, one scan in, as recorded:", found]
    return "\n\n".join(parts)


def _metrics(store: Path, protocol: str) -> dict[str, Any]:
    return json.loads((_evaluation(store, protocol) / "metrics.json").read_text("utf-8"))


if __name__ == "__main__":
    begin(run, Settings, "experiments.shipped_weights")
