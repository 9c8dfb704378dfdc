# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`report.html` of a drive: the scene played over time, and each vehicle with its shape."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from wildshape.arguments import as_path
from wildshape.drives.result import REPORT
from wildshape.drives.source import Drive
from wildshape.drives.writing.finished import FinishedDrive, FoundVehicle, read_finished
from wildshape.drives.writing.playback.moments import readable_source
from wildshape.errors import BadInputError
from wildshape.geometry.sampling import thin
from wildshape.inference.registration import fuse_scans, to_middle
from wildshape.io.progress import counted, duration
from wildshape.parallel.team import ALONE, Team
from wildshape.records import Points, as_text
from wildshape.report.content import Cell, Cloud, Report, ReportObject, SceneView, Table
from wildshape.report.drive.picture import for_picture, picture_from_above
from wildshape.report.drive.scene import DrawnScan, drawn_scans, scene_data
from wildshape.report.page.html import write_report
from wildshape.report.results import (
    MEANING,
    OBJECTS,
    PROBABILITIES,
    TrackResult,
    box_of,
    chances_in,
    read_result,
)

MOST_OBJECTS = 150
_POINTS = 2500  # of a panel
_SHOWN_S = 0.05  # less of a stage reads 0.0
_NOTES = (
    "Drift can be told only where true poses are known: wildshape evaluate-drive measures it.",
)
_ADAPTED = (
    "Boxes and shapes are of a model adapted to what was found (--adapt); those of the model it"
    " began with are in first/.",
)
_COLUMNS = (
    "vehicle",
    "motion",
    "confidence",
    *PROBABILITIES.values(),
    "length, m",
    "width, m",
    "height, m",
    "frames",
    "seen, s",
    "nearest, m",
    "most points",
)
_UNTIMED = tuple("seen, frames" if name == "seen, s" else name for name in _COLUMNS)


def report_from_drive(out: Path, moved: Path | None = None, helpers: Team = ALONE) -> Report:
    """The page of a finished drive.

    Args:
        out: the drive's folder.
        moved: where the recording is now, if it is no longer where it was. Where it cannot be read
            the scene shows no scans.
        helpers: who reads and draws.

    Raises:
        BadInputError: no finished drive, or a damaged one; `moved` is another recording.
    """
    found = read_finished(out)
    source = found.open_source(moved) if moved else readable_source(found)
    return drive_report(found, source, helpers)


def write_drive_report(out: Path | str, helpers: Team = ALONE) -> None:
    """Write `report.html` into a finished drive's folder; `helpers`: who reads and draws.

    Raises:
        BadInputError: no finished drive, or a damaged one.
    """
    out = as_path(out, "out")
    write_report(report_from_drive(out, helpers=helpers), out / REPORT)


def drive_report(found: FinishedDrive, drive: Drive | None, helpers: Team = ALONE) -> Report:
    """The page's content; without the recording the scene shows no scans."""
    said = found.record.get("result") or {}
    gone = () if drive is not None else (f"{found.source} cannot be read: no scans are drawn.",)
    adapted = _ADAPTED if "adapted" in found.record else ()
    shown = found.vehicles[:MOST_OBJECTS]
    scans = drawn_scans(found, drive, helpers=helpers)
    parts: tuple[Callable[[], Any], ...] = (
        partial(_scene_and_objects, found, scans, shown),
        partial(picture_from_above, found, for_picture(scans)),
    )
    (scene, objects), picture = helpers.in_order(_done, parts)
    return Report(
        title=f"Wildshape drive: {as_text(found.name)}",
        facts=tuple(_facts(found)),
        scene=SceneView(scene, picture),
        index=(_index(found),) if found.vehicles else (),
        objects=objects,
        cost=tuple(_cost(said.get("seconds") or {})),
        notes=(*gone, *adapted, *map(str, said.get("warnings") or ()), *_NOTES),
        provenance=found.record.get("provenance") or {},
    )


def _done(part: Callable[[], Any]) -> Any:
    return part()


def _scene_and_objects(
    found: FinishedDrive, scans: list[DrawnScan], shown: Sequence[FoundVehicle]
) -> tuple[dict[str, Any], tuple[ReportObject, ...]]:
    return scene_data(found, scans), tuple(_object(found, one) for one in shown)


def _facts(found: FinishedDrive) -> list[tuple[str, str]]:
    moving = sum(one.moving for one in found.vehicles)
    return [
        ("vehicles", str(len(found.vehicles))),
        ("of them moving", str(moving)),
        ("scans", str(len(found))),
        *([("time", f"{found.seconds[-1]:.1f} s")] if found.times else []),
        ("way of the sensor", f"{found.travelled_m:.0f} m"),
    ]


def _cost(seconds: dict[str, float]) -> list[tuple[str, str]]:
    """All of it and each stage that took time: some are done along with the one before."""
    if not seconds:
        return []
    stages = [(stage, f"{spent:.1f} s") for stage, spent in seconds.items() if spent >= _SHOWN_S]
    return [("all of it", duration(sum(seconds.values()))), *stages]


def _index(found: FinishedDrive) -> Table:
    rows = tuple(_row(found, one) for one in found.vehicles)
    count = range(len(rows))
    return Table(
        title=counted(len(rows), "vehicle"),
        columns=_COLUMNS if found.times else _UNTIMED,
        rows=rows,
        caption="Click a row for its complete shape and its scans."
        f" {MEANING} That of what is seen driving is raised. What was seen too briefly to tell is"
        " called standing, too.",
        sortable=True,
        objects=tuple(i if i < MOST_OBJECTS else None for i in count),
    )


def _row(found: FinishedDrive, one: FoundVehicle) -> tuple[Cell, ...]:
    chances = _chances(found, one)
    return (
        one.name,
        "moving" if one.moving else "standing",
        f"{one.confidence:.2f}",
        *(chances.get(words) for words in PROBABILITIES.values()),
        *(f"{side:.2f}" for side in one.size),
        len(one.frames),
        _seen(found, one),
        f"{one.nearest_m:.1f}",
        max(one.points),
    )


def _seen(found: FinishedDrive, one: FoundVehicle) -> str:
    first, last = one.frames[0], one.frames[-1]
    if not found.times:
        return f"{first} to {last}"
    return f"{found.seconds[first]:.1f} to {found.seconds[last]:.1f}"


def _chances(found: FinishedDrive, one: FoundVehicle) -> dict[str, str]:
    """Its probabilities, the means over its completed scans."""
    chances = chances_in(found.out / "objects" / one.name)
    return {words: f"{chance:.2f}" for words, chance in chances.items()}


def _object(found: FinishedDrive, one: FoundVehicle) -> ReportObject:
    """Panels in the sensor frame of its fullest completed scan."""
    result = read_result(found.out / "objects" / one.name)
    if not result.scans:
        raise BadInputError(f"{result.folder / OBJECTS}: no scan in it; write it anew.")
    scans = {name: found.scan(one, name) for name in result.scans}
    scan = max(scans, key=lambda name: len(scans[name]))
    entry = result.entry(scan)
    clouds = [Cloud("input scan", scans[scan], size=2.6), *_fused(result, scans, scan)]
    completed = result.completed(scan)
    if completed is not None:
        clouds.append(Cloud("completed", thin(completed, _POINTS)))
    size = " x ".join(f"{side:.2f}" for side in one.size)
    together = f"{counted(len(scans), 'scan')} completed together"
    return ReportObject(
        name=one.name,
        subtitle=f"scan {scan}, {together}{_lost(found, one, scans)}",
        clouds=tuple(cloud for cloud in clouds if len(cloud.points)),
        box=box_of(entry),
        details=(
            ("box", f"{size} m"),
            ("confidence", f"{one.confidence:.2f}"),
            *_chances(found, one).items(),
            ("motion", "moving" if one.moving else "standing"),
            ("frames", f"{one.frames[0]} to {one.frames[-1]}"),
        ),
        paper=False,
    )


def _lost(found: FinishedDrive, one: FoundVehicle, scans: dict[str, Points]) -> str:
    """Those whose files are gone or damaged since; what another vehicle took has no points."""
    had = {found.scan_names[frame]: points for frame, points in zip(one.frames, one.points)}
    count = sum(not len(scan) and had.get(name, 0) > 0 for name, scan in scans.items())
    return f"; {count} of them cannot be read any more" if count else ""


def _fused(result: TrackResult, scans: dict[str, Points], scan: str) -> list[Cloud]:
    """All its completed scans, by their poses, in the frame of one."""
    poses = result.poses()
    if poses is None or len(scans) < 2 or len(poses) != len(scans):
        return []
    T_middle_scan = to_middle(poses)
    T_scan_middle = T_middle_scan[list(scans).index(scan)].inverse()
    fused = fuse_scans(list(scans.values()), T_middle_scan)
    return [Cloud("fused by us", thin(T_scan_middle.apply_numpy(fused), _POINTS))]
