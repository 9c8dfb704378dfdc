# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Self-training: what a trained network and the scans of a whole track teach the next network.

Beyond the paper (METHOD 11.3). A network trained as the paper has it poses every scan; the scans of
a track are then made to fit each other (`joint_icp.py`, `pose_graph.py`), headings agreed on
(`headings.py`), and fused (`fused_shape.py`). The fused, reflected cloud and the refined poses are
targets that a network can be taught from ONE scan of the track. No label enters.

Each rule is a file of its own with its numbers in a frozen record; `SelfTrainingConfig` holds the
records and `fused_targets` calls the rules, one after the other.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, Float32, Int64
from torch import Tensor

from wildshape.errors import BadInputError
from wildshape.geometry.gravity import level_turn
from wildshape.geometry.projection.field_of_view import slope, view_top
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.config import TrackConfig
from wildshape.inference.predictor import Predictor, load
from wildshape.inference.tracks.joint_icp import fused, refine_jointly, stayed_near
from wildshape.inference.tracks.pose_outliers import without_outliers
from wildshape.method.checkpoint import ModelSettings, load_checkpoint
from wildshape.method.network import ShapePoseNet
from wildshape.parallel.team import team
from wildshape.records import Points
from wildshape.training.batches.fused import DrawConfig, FusedTargets
from wildshape.training.batches.views import ViewSampler
from wildshape.training.self_training.fused_shape import (
    FusionConfig,
    exactly,
    fused_shape,
    sensors_of,
)
from wildshape.training.self_training.heading_profiles import profile, together
from wildshape.training.self_training.heading_transfer import (
    TransferConfig,
    check_transfer,
    transferred_signs,
)
from wildshape.training.self_training.headings import (
    HeadingConfig,
    PosedTrack,
    pose_track,
    settled_signs,
    signs_across,
    signs_within,
    turned_as_wholes,
)
from wildshape.training.self_training.objective import TaughtLossConfig
from wildshape.training.self_training.pose_graph import PoseGraphConfig, refine_by_graph
from wildshape.training.self_training.posed_parts import PosedParts
from wildshape.training.self_training.targets import targets_of
from wildshape.training.self_training.unseen_roof import RoofConfig, unseen_roof

Progress = Callable[[int, int], None]
Fronts = Float[Tensor, "S 3"]


@dataclass(frozen=True)
class SelfTrainingConfig:
    """Everything that decides what a network is taught by another, but the networks.

    It is saved with every model and run, in the recipe. Lengths are for vehicles. Those by
    which scans are posed, compared and fused shrink with smaller objects (`unit_of`); those of the
    ground, of roofs and of profiles do not.

    Attributes:
        headings: which way tracks look; also agreed on in the midst of a run without a teacher.
        transfer: which way views look, asked of weights of another sensor.
        track: outliers among the poses, and how scans are moved onto the mean of all.
    """

    headings: HeadingConfig = field(default_factory=HeadingConfig)
    transfer: TransferConfig = field(default_factory=TransferConfig)
    track: TrackConfig = field(default_factory=TrackConfig)
    graph: PoseGraphConfig = field(default_factory=PoseGraphConfig)
    fusion: FusionConfig = field(default_factory=FusionConfig)
    roof: RoofConfig = field(default_factory=RoofConfig)
    draw: DrawConfig = field(default_factory=DrawConfig)
    loss: TaughtLossConfig = field(default_factory=TaughtLossConfig)


_DEFAULT = SelfTrainingConfig()


@dataclass(frozen=True)
class Teacher:
    """Who poses the scans, and what is known of them.

    Attributes:
        settings: of its checkpoint.
        views: of the tracks trained on, as the next network reads them.
        asked: of the same tracks, as the teacher reads them.
        time_ordered: the scans of a track follow each other (`LossConfig.time_ordered`).
        headings: is asked which way each scan looks; None if the tracks agree among themselves.
        fronts: where the object of each scan of the store looks, where that is known.
    """

    network: ShapePoseNet
    settings: ModelSettings
    views: ViewSampler
    asked: ViewSampler
    time_ordered: bool
    headings: Predictor | None
    config: SelfTrainingConfig
    fronts: Fronts | None = None

    @classmethod
    def of(
        cls,
        checkpoint: Path,
        views: ViewSampler,
        config: SelfTrainingConfig,
        *,
        time_ordered: bool,
        headings: Path | None,
        fronts: Fronts | None = None,
    ) -> "Teacher":
        """From checkpoints.

        Raises:
            BadInputError: a checkpoint cannot be used, or is of another kind of sensor.
        """
        network, settings = load_checkpoint(checkpoint)
        if settings.sensor != views.config.sensor:
            raise BadInputError(
                f"{checkpoint}: was trained on {settings.sensor} scans and cannot teach"
                f" {views.config.sensor} scans; choose a teacher of their kind."
            )
        turn = "facing" if settings.facing else "none"
        read = replace(views.config, points=settings.input_points, turn=turn)
        asked = ViewSampler(views.store, np.arange(len(views.store)), read)
        asked.scans_of = views.scans_of
        other = None if headings is None else load(headings, raw=True)
        if other is not None:
            check_transfer(other)
        return cls(network, settings, views, asked, time_ordered, other, config, fronts)

    @property
    def mirror(self) -> bool:
        """Objects are symmetric in the plane y = 0."""
        return self.settings.network.mirror

    @property
    def is_lidar(self) -> bool:
        """The scans are of a LiDAR, which is held level and sees the ground."""
        return self.settings.sensor == "lidar"

    @property
    def unit(self) -> float:
        """Metres of the unit in which the rules' lengths are meant."""
        return self.settings.unit

    def clouds(self, track: PosedTrack) -> list[Points]:
        """The scans of a track, in units."""
        scans = (self.views.store.scan_points(int(scan)) for scan in track.scans)
        return [scan / np.float32(self.unit) for scan in scans]


@torch.no_grad()
def fused_targets(
    teacher: Path,
    sampler: ViewSampler,
    progress: Progress = lambda *_: None,
    config: SelfTrainingConfig = _DEFAULT,
    *,
    time_ordered: bool = True,
    headings: Path | None = None,
    fronts: Fronts | None = None,
    parts: PosedParts,
) -> FusedTargets:
    """Targets for all scans of a sampler, from a checkpoint and the scans alone.

    Args:
        teacher: poses the scans.
        sampler: of the tracks trained on.
        progress: called with the tracks done, and their number.
        config: the rules' numbers.
        time_ordered: the scans of a track follow each other (`LossConfig.time_ordered`).
        headings: another checkpoint, asked which way each scan looks (`heading_transfer.py`).
        fronts: directions in which the objects look, sensor frame of each scan of the store;
            poses that look the other way are turned, and no one is asked.
        parts: keeps the tracks that are posed, and has kept some if the work was stopped.

    Raises:
        BadInputError: a checkpoint cannot be used.
    """
    who = Teacher.of(
        teacher, sampler, config, time_ordered=time_ordered, headings=headings, fronts=fronts
    )
    tracks, votes = [], []
    known = parts.found(sampler.scans_of)
    with team() as helpers:
        rest = sampler.scans_of[len(known) :]
        each = helpers.in_order(partial(posed_together, who), rest)
        posed = chain(known, parts.kept(each, len(known)))
        for done, (track, signs) in enumerate(posed, start=1):
            tracks.append(track)
            votes.append(signs)
            progress(done, len(sampler.scans_of))
        if who.headings is None and fronts is None:
            shapes = list(helpers.in_order(partial(shape_of, who), tracks))
            tracks = agreed_tracks(shapes, tracks, votes, config)
        if who.is_lidar:
            tracks = [levelled(track) for track in tracks]
        shapes, tops = zip(*helpers.in_order(partial(whole_shape, who), tracks))
    return targets_of(sampler, tracks, list(shapes), list(tops), config.fusion, complete=False)


def posed_together(
    teacher: Teacher, scans: Int64[np.ndarray, "V"]
) -> tuple[PosedTrack, Float[Tensor, "V"]]:
    """A track as the teacher poses it, its scans moved onto each other; their heading votes."""
    posed = pose_track(teacher.network, teacher.asked, teacher.settings, scans)
    votes = heading_votes(teacher, posed)
    return refined(teacher, posed.turned(votes)), votes


def heading_votes(teacher: Teacher, track: PosedTrack) -> Float[Tensor, "V"]:
    """+1 or -1 for each scan of a track: turn those of -1 and they look one way."""
    config, unit = teacher.config, teacher.unit
    if teacher.fronts is not None:
        looks = track.T_sensor_can.rotation[:, :, 0]
        known = teacher.fronts[torch.from_numpy(track.scans)].to(looks.dtype)
        return torch.where((looks * known).sum(-1) < 0, -1.0, 1.0)
    if teacher.headings is not None:
        in_units = track.T_sensor_can.scaled(1 / unit)
        return transferred_signs(teacher.headings, teacher.clouds(track), in_units, config.transfer)
    return signs_within(
        teacher.asked,
        track,
        config.headings,
        time_ordered=teacher.time_ordered,
        mirror=teacher.mirror,
    )


def refined(teacher: Teacher, track: PosedTrack) -> PosedTrack:
    """The scans of a track moved onto each other, and those in time order onto their neighbours."""
    config, clouds = teacher.config, teacher.clouds(track)
    ordered, start = teacher.time_ordered, track.T_sensor_can.scaled(1 / teacher.unit)
    if ordered:
        sure, most = torch.ones(len(clouds)), config.track.most_points
        seen = fused(clouds, start.to(torch.float64), slice(None), most).to(start.rotation)
        start = without_outliers(start, clouds, seen, sure, config.track)
    found = refine_jointly(clouds, start, mirror=teacher.mirror, config=config.track.coarse)
    if ordered:
        found = chained(clouds, found, config)
    return track._replace(T_sensor_can=found.scaled(teacher.unit))


def chained(scans: list[Points], T_sensor_can: SE3, config: SelfTrainingConfig = _DEFAULT) -> SE3:
    """Poses that fit their neighbours, unless a scan would jump."""
    found = refine_by_graph(scans, T_sensor_can, config.graph)
    stayed = bool(stayed_near(T_sensor_can, found, config.track).all())
    return found if stayed else T_sensor_can


def agreed_tracks(
    shapes: Sequence[Float32[np.ndarray, "G 3"]],
    tracks: Sequence[PosedTrack],
    votes: Sequence[Float[Tensor, "_"]],
    config: SelfTrainingConfig = _DEFAULT,
) -> list[PosedTrack]:
    """The tracks turned so that all look one way, as profiles and the teacher itself say."""
    rules = config.headings
    profiles = together([profile(torch.from_numpy(shape), rules.profile) for shape in shapes])
    signs = signs_across(profiles, votes, rules.profile)
    signs = settled_signs(tracks, votes, profiles, signs, rules)
    return turned_as_wholes(tracks, signs)


def levelled(track: PosedTrack) -> PosedTrack:
    """A track in a frame that does not pitch against its sensors (`geometry/gravity.py`)."""
    posed = track.T_sensor_can
    rotation = posed.rotation @ level_turn(posed.rotation)
    return track._replace(T_sensor_can=SE3(rotation, posed.translation))


def shape_of(teacher: Teacher, track: PosedTrack) -> Float32[np.ndarray, "G 3"]:
    """What the scans of a track show together."""
    config = teacher.config.fusion
    voxel = teacher.unit * config.voxel_m(teacher.settings.sensor)
    return fused_shape(teacher.views, track, config, mirror=teacher.mirror, voxel_m=voxel)


def whole_shape(teacher: Teacher, track: PosedTrack) -> tuple[Float32[np.ndarray, "G 3"], float]:
    """What a track shows, with a vehicle's roof, and where its view ended above."""
    shape = shape_of(teacher, track)
    if not teacher.is_lidar:
        return shape, math.inf  # a camera's view ends where its image does: not on objects
    top = view_top_of(teacher.views, track.scans)
    return with_roof(teacher, shape, track, top), top


def with_roof(
    teacher: Teacher, shape: Float32[np.ndarray, "G 3"], track: PosedTrack, top: float
) -> Float32[np.ndarray, "G 3"]:
    """With the roof that no sensor could see, as many points; `top`: where their view ended."""
    config = teacher.config
    sensors = sensors_of(track, config.fusion.sensors)
    roof = unseen_roof(torch.from_numpy(shape), sensors, top, config.roof, mirror=teacher.mirror)
    return exactly(np.concatenate((shape, roof.numpy())), len(shape))


def view_top_of(views: ViewSampler, scans: Int64[np.ndarray, "V"]) -> float:
    """Where a LiDAR's view of a track ended above."""
    clouds = (torch.from_numpy(views.store.scan_points(int(scan))) for scan in scans)
    return view_top([float(slope(cloud).max()) for cloud in clouds])
