# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The stages of a drive, one after the other, from the sensor's mounting to the files written.

A stage whose files are in the output folder is not run again: a killed run goes on.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from wildshape.drives.adapting import second_pass
from wildshape.drives.clock import Clock
from wildshape.drives.completing.boxes import faced, smooth
from wildshape.drives.completing.completion import Completer
from wildshape.drives.completing.level_frame import (
    Completed,
    level_poses,
    on_ground,
    read_completed,
)
from wildshape.drives.completing.merging import Places
from wildshape.drives.completing.rolling_shutter import TURNS, Turns, with_sense
from wildshape.drives.completing.selection import Selector
from wildshape.drives.completing.vehicles import (
    likely,
    stated,
    surer_if_driving,
    write_judged,
)
from wildshape.drives.config import DriveConfig
from wildshape.drives.recording_checks import (
    backwards_told,
    clock_told,
    count_told,
    has_times,
    rate_told,
    sideways_told,
    tipped_told,
)
from wildshape.drives.result import DriveResult
from wildshape.drives.source import Drive
from wildshape.drives.tracking.box_cutter import BoxCutter, check_cut
from wildshape.drives.tracking.detections import Detections, given_tracks
from wildshape.drives.tracking.mounting import Mounting, find_mounting
from wildshape.drives.tracking.segmentation import Cutter, read_cuts
from wildshape.drives.tracking.sightings import Sightings, read_sightings, write_sightings
from wildshape.drives.tracking.static_tracks import joined_where_they_stand
from wildshape.drives.tracking.tracks import linked_clusters
from wildshape.drives.tracking.trajectory import (
    Breaks,
    find_trajectory,
    jumps,
    usual_step_m,
)
from wildshape.drives.writing.folder import BOXES, FRAMES, TRAJECTORY
from wildshape.drives.writing.outputs import (
    RayWriter,
    Vehicle,
    VehicleWriter,
    write_frames,
    write_trajectories,
)
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.folders.complete_folder import OBJECTS
from wildshape.inference.predictor import Predictor
from wildshape.io.atomic import write_json
from wildshape.io.boxes.table import BoxRow, write_box_table
from wildshape.io.guard import read_record
from wildshape.io.poses import read_poses
from wildshape.parallel.team import Team

SECONDS, SECOND = "seconds.json", "second "


@dataclass(frozen=True)
class Pipeline:
    """One drive on its way through the stages.

    Attributes:
        helpers: processes that cut scans and complete objects.
        detections: of somebody else's detector, in place of the clusters.
        second: whether this is the pass with an adapted model.
    """

    drive: Drive
    out: Path
    config: DriveConfig
    predictor: Predictor
    helpers: Team
    detections: Detections | None
    clock: Clock
    second: bool = False

    @property
    def stages(self) -> Path:
        """What each stage leaves for the next."""
        return self.out / "stages"

    @property
    def completing(self) -> Path:
        """The same of completion and what follows, of this pass."""
        return second_pass.stages_of(self.out) if self.second else self.stages

    @property
    def results(self) -> Path:
        """What the user gets, of this pass."""
        return second_pass.results_of(self.out) if self.second else self.out

    @property
    def cuts(self) -> Path:
        """A file of clusters a frame."""
        return self.stages / "clusters"

    def again(self, model: str, first: DriveResult) -> DriveResult:
        """A second pass with an adapted model; its results take the place of the first's."""
        second_pass.begin_second(self.out, model)
        adapted = second_pass.like(self.predictor, Path(model))
        once = {n: s for n, s in first.seconds.items() if not n.startswith(SECOND)}
        clock = self.clock.going_on(second_pass.stages_of(self.out) / SECONDS, SECOND, once)
        found = replace(self, predictor=adapted, clock=clock, second=True).perform()
        return second_pass.conclude(self.out, found, model)

    def perform(self) -> DriveResult:
        """All stages."""
        mounting = self.mounting()
        T_world_sensor = self.trajectory(mounting)
        moved = replace(self, drive=self.drive.moved_by(T_world_sensor))
        return moved.find(mounting, T_world_sensor)

    def find(self, mounting: Mounting, T_world_sensor: SE3) -> DriveResult:
        """All that follows from the sensor's way: scans are corrected by it."""
        self.cut(mounting)
        T_level_sensor = level_poses(T_world_sensor, mounting)
        objects = self.tracks(T_level_sensor)
        self.complete("completion", objects, mounting, T_level_sensor)
        turns = self.turns(objects, T_level_sensor)
        places = Places(turns, self.config.merging, self.config.boxes)
        completed = self.completed(objects, turns)
        parts = self.merged(completed, places)
        self.complete("merging", parts, mounting, T_level_sensor)
        completed += self.completed(parts, turns)
        vehicles = self.vehicles([*objects, *parts], completed, places)
        turned = [one.completed.turned for one in vehicles if one.way.moving]
        return DriveResult(
            out=self.out,
            frames=len(self.drive),
            candidates=len(objects),
            vehicles=tuple(one.name for one in vehicles),
            boxes=self.write(vehicles, turns),
            moving=len(turned),
            warnings=(*self.warnings(T_world_sensor, mounting), *backwards_told(turned)),
            seconds=self.clock.seconds,
            workers=self.helpers.worked,
        )

    def mounting(self) -> Mounting:
        """How the sensor is held."""
        path = self.stages / "mounting.json"
        with self.clock.stage("mounting", 1) as at:
            if not path.is_file():
                write_json(path, asdict(find_mounting(self.drive, self.config.mounting)))
            at(1)
            return read_record(path, "the sensor's mounting", Mounting)

    def trajectory(self, mounting: Mounting) -> SE3:
        """`T_world_sensor` of each frame; scans without times of points are cut on the way."""
        path = self.out / TRAJECTORY
        with self.clock.stage("trajectory", len(self.drive)) as at:
            if not path.is_file():
                cutter = self.cutter(mounting)
                scans = self.helpers.in_order(cutter.landmarks, range(len(self.drive)))
                found = find_trajectory(self.drive, mounting, self.config, at, scans)
                write_json(self.stages / "breaks.json", asdict(found.breaks))
                write_trajectories(self.out, self.drive, found.T_world_sensor)
            return read_poses(path, len(self.drive))

    @property
    def breaks(self) -> Breaks:
        """Where the sensor's way breaks off."""
        return Breaks.read(self.stages / "breaks.json")

    def cut(self, mounting: Mounting) -> None:
        """Clusters of the scans that are not cut yet."""
        cutter = self.cutter(mounting)
        self.spread("clusters", cutter, cutter.missing(), len(self.drive))
        if self.detections is not None:
            check_cut(self.detections, read_cuts(self.cuts, len(self.drive)))

    def cutter(self, mounting: Mounting) -> Cutter:
        """Cuts by the detections, where there are some."""
        known = self.drive, mounting, self.cuts, self.config
        return Cutter(*known) if self.detections is None else BoxCutter(*known, self.detections)

    @property
    def tracked(self) -> bool:
        """Whether the detections bring their own tracks."""
        return self.detections is not None and self.detections.tracked

    def spread(self, stage: str, task: Callable[[Any], None], items: list[Any], total: int) -> None:
        """Do what is missing of a stage, by several processes where that is worth it."""
        with self.clock.stage(stage, total) as at:
            for number, _ in enumerate(self.helpers.as_done(task, items), total - len(items) + 1):
                at(number)

    def tracks(self, T_level_sensor: SE3) -> list[Sightings]:
        """Objects followed from scan to scan."""
        path = self.stages / "tracks.json"
        with self.clock.stage("tracks", 1) as at:
            if not path.is_file():
                write_sightings(path, self.linked(T_level_sensor))
            at(1)
            return read_sightings(path)

    def linked(self, T_level_sensor: SE3) -> list[Sightings]:
        """The same, found now."""
        if self.tracked:
            return given_tracks(read_cuts(self.cuts, len(self.drive)))
        config = self.config.tracks
        if self.detections is not None:
            config = replace(config, longest_gap=config.longest_gap * self.detections.every)
        ticks = self.breaks.ticks(self.drive.moments, config)
        known = self.cuts, T_level_sensor
        wider = config.wider(self.seen_s, self.step_m(T_level_sensor))
        found = linked_clusters(*known, ticks, config, wider)
        return joined_where_they_stand(found, *known, self.config.standing, self.breaks.frames)

    @property
    def seen_s(self) -> float | None:
        """From a scan that is looked at to the next, seconds, if known: not all have detections."""
        if self.detections is None or self.detections.every == 1:
            return self.drive.scan_s
        return (self.drive.scan_s or self.config.tracks.usual_s) * self.detections.every

    def step_m(self, T_world_sensor: SE3) -> float:
        """How far the sensor goes meanwhile."""
        every = 1 if self.detections is None else self.detections.every
        return every * usual_step_m(T_world_sensor, self.drive.moments)

    def folder(self, seen: Sightings) -> Path:
        """Of a completed object."""
        return self.completing / "objects" / seen.name

    def complete(
        self, stage: str, objects: list[Sightings], mounting: Mounting, T_level_sensor: SE3
    ) -> None:
        """Shapes of the objects that are not completed yet."""
        tilt = mounting.levelling() if mounting.is_tilted else None
        completer = Completer(
            self.predictor,
            self.drive,
            self.cuts,
            self.completing / "objects",
            tilt,
            T_level_sensor if tilt is None else T_level_sensor @ tilt.inverse(),
            self.config,
        )
        self.spread(stage, completer, completer.missing(objects), len(completer.groups(objects)))

    def turns(self, objects: list[Sightings], T_level_sensor: SE3) -> Turns:
        """The sensor's turns, in their sense where points have no times."""
        found = Turns(self.drive.moments, T_level_sensor, breaks=self.breaks.frames)
        if not has_times(self.drive):
            shown = ((one.frames, one.boxes) for one in self.completed(objects, found))
            found = with_sense(found, shown, self.config.turns)
        write_json(self.stages / TURNS, {"sense": found.sense, "ticks": found.ticks})
        return found

    def completed(self, objects: list[Sightings], turns: Turns) -> list[Completed]:
        """Those that were not ruled out."""
        return [
            faced(
                read_completed(seen, self.folder(seen), self.drive, turns), turns, self.config.boxes
            )
            for seen in objects
            if (self.folder(seen) / OBJECTS).is_file()
        ]

    def merged(self, completed: list[Completed], places: Places) -> list[Sightings]:
        """Tracks that are one object by their shapes, put together."""
        path = self.completing / "merged.json"
        if not path.is_file():
            least = self.config.merging.least_confidence
            found = [] if self.tracked else likely(completed, least, self.config.vehicles)
            write_sightings(path, places.fragments(found))
        return read_sightings(path)

    def vehicles(
        self, objects: list[Sightings], completed: list[Completed], places: Places
    ) -> list[Vehicle]:
        """Which of the objects are vehicles, and where they are; `completed`: not ruled out."""
        turns, boxes = places.turns, self.config.boxes
        known = self.drive, self.cuts, self.config, self.tracked, self.helpers.in_order
        with self.clock.stage("vehicles", 1) as at:
            judged = [
                surer_if_driving(one, self.cuts, turns, boxes, self.config.vehicles)
                for one in completed
            ]
            found, said = Selector(*known)(judged, places)
            write_judged(self.completing / "vehicles.json", objects, said)
            found = [on_ground(one, self.cuts, turns, boxes) for one in found]
            at(1)
            sure = {one.name: one.confidence for one in said}
            return [
                Vehicle(one, smooth(one, turns, boxes), stated(one, sure))
                for one in sorted(found, key=lambda one: one.seen.name)
            ]

    def write(self, vehicles: list[Vehicle], turns: Turns) -> int:
        """The user's files; how many boxes they hold."""
        if self.config.rays:
            writer = RayWriter.of(self.results, vehicles, self.drive, self.cuts)
            self.spread("rays", writer, sorted(writer.files), len(writer.files))
        folders, rows = self.completing / "objects", list[BoxRow]()
        with self.clock.stage("outputs", len(vehicles)) as at:
            known = self.cuts, self.drive, turns, self.config.boxes
            write = VehicleWriter(self.results, folders, *known)
            for number, found in enumerate(self.helpers.in_order(write, vehicles), 1):
                rows += found
                at(number)
            write_box_table(self.results / BOXES, rows)
        return len(rows)

    def warnings(self, T_world_sensor: SE3, mounting: Mounting) -> tuple[str, ...]:
        """What is odd about the drive; writes `frames.csv` on the way."""
        cuts = [(cut.scanned, len(cut.counts)) for cut in read_cuts(self.cuts, len(self.drive))]
        points, kept = [scanned for scanned, _ in cuts], sum(count for _, count in cuts)
        write_frames(self.out / FRAMES, self.drive, points)
        found = [*self.drive.warnings, *mounting.told()]
        if empty := points.count(0):
            found.append(f"{empty} of {len(points)} scans are empty or cannot be read")
        found += self.breaks.told() + clock_told(self.drive)
        found += sideways_told(self.drive, T_world_sensor)
        found += tipped_told(T_world_sensor, mounting.up)
        found += count_told(len(points) - points.count(0))
        if not self.tracked:
            found += rate_told(self.seen_s, self.step_m(T_world_sensor), self.config.tracks)
        if self.detections is not None:
            tracks = read_sightings(self.stages / "tracks.json")
            followed = sum(len(rows) for one in tracks for rows in one.rows)
            found += self.detections.told(kept, followed)
        if leaps := list(jumps(T_world_sensor, self.drive.moments, self.config.trajectory)):
            found.append(f"jumps of the sensor: {len(leaps)}, the first at frame {leaps[0]}")
        return tuple(found)
