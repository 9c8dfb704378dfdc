# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The numbers that decide what `drive` finds, in frozen records, a record a stage.

They are written into `wildshape.json` of every result and can be set from Python:
`wildshape.drive("recording", "found", DriveConfig(clusters=ClusterConfig(range_m=40.0)))`.
"""

from dataclasses import dataclass, field, replace

from wildshape.drives.object_config import (
    AssociationConfig,
    BoxConfig,
    CompletionConfig,
    DeskewConfig,
    DrivingConfig,
    MergeConfig,
    OwnVehicleConfig,
    SurroundingsConfig,
    TurnConfig,
    VehicleConfig,
)
from wildshape.inference.config import InferenceConfig, JointIcpConfig, TrackConfig

INFERENCE = InferenceConfig(
    track=TrackConfig(
        coarse=JointIcpConfig(rounds=6, normal_points=16, normal_rounds=6),
        fine=replace(TrackConfig().fine, rounds=6, points=256),
    )
)
"""How `drive` completes objects: tracks in fewer rounds; boxes are as good."""


@dataclass(frozen=True)
class MountingConfig:
    """How the sensor's height and tilt are found from the ground (`mounting.py`).

    Attributes:
        scans: of the drive, evenly spread, that are looked at.
        reach_m: the ground is flat enough only so near.
        trials: planes that are tried in each scan.
        thick_m: points this near to a plane lie on it.
        steepest_deg: no sensor is mounted with more tilt.
        below: share of the points that may lie below the ground: reflections, ditches.
        ground: a larger share of the points nearby lies on the ground: on real and simulated
            streets 0.28 and more.
        object_m: scans that are smaller are of an object; the longest lorries are as long.
        level_deg: less tilt than this is the road's, not the sensor's, and is left alone.
    """

    scans: int = 9
    reach_m: float = 15.0
    trials: int = 300
    thick_m: float = 0.1
    steepest_deg: float = 35.0
    below: float = 0.03
    ground: float = 0.2
    object_m: float = 20.0
    level_deg: float = 2.0


@dataclass(frozen=True)
class TrajectoryConfig:
    """How the sensor's way is found (`trajectory.py`), by KISS-ICP with its own other settings.

    Attributes:
        range_m: farthest points that are used.
        nearest_m: nearer ones are the vehicle that carries the sensor.
        ground_m: nearer ground tells the sensor's height and tilt.
        ground_cell_m: size of the ground map's cells.
        ground_reach_m: ground farther from that of the map is another one.
        standing_m: what is higher above the ground is none of it.
        overhead_m: a ceiling is looked for so near.
        overhead: what rises by more than this a metre of range may be a ceiling.
        ceiling: it is one if heights vary by a smaller share of what they would if all of it were
            equally far, as walls are: on real streets 0.9 and more, at a flat ceiling 0.01.
        ceiling_m: what is so much below its height is it, too.
        voxel_m: size of the local map's cells.
        settled: a scan has found its place when a step moves it by less, metres and radians.
        fits_m: points this near to one of the scan before fit it.
        least_fit: a scan of which a smaller share fits the one before, and the reverse, was taken
            elsewhere: the odometry begins anew. On real and simulated streets 0.71 and more fit,
            0.86 of one that lost most of its packets, of scans taken elsewhere at most 0.24.
        good_fit: a scan of which a smaller share fits is tried from other places; motorways at
            33 m/s may fit by 0.18 from where the sensor was, and by 0.76 from 3.3 m ahead.
        longest_guess: scans over which a motion is believed to go on; a recording that paused for
            longer may go on anywhere, but mostly where it was.
        jump_m: steps of neighbouring scans that differ by more are counted as a jump. At 10 Hz no
            vehicle changes its speed by 20 m/s in between.
    """

    range_m: float = 100.0
    nearest_m: float = 2.0
    ground_m: float = 20.0
    ground_cell_m: float = 1.0
    ground_reach_m: float = 0.5
    standing_m: float = 0.2
    overhead_m: float = 10.0
    overhead: float = 0.05
    ceiling: float = 0.25
    ceiling_m: float = 0.2
    voxel_m: float = 0.75
    settled: float = 1e-3
    fits_m: float = 1.0
    least_fit: float = 0.5
    good_fit: float = 0.8
    longest_guess: int = 20
    jump_m: float = 2.0


@dataclass(frozen=True)
class GroundConfig:
    """What is ground (`ground.py`), by Patchwork++ with its own other settings.

    Attributes:
        range_m: farther points are neither ground nor object.
        nearest_m: nearer points are the vehicle that carries the sensor.
        cell_m: the ground's height is kept in cells of this size: over more of it roads slope.
        below_m: what lies lower than this under the ground at the sensor is a reflection.
        steepest: it may lie lower by so much a metre of range; no road falls faster.
        reflected: reflections are left out where they are more than this share of a scan's points.
        beside: within so many of the sensor's heights ground must be low: too near for the lowest
            beam to meet the road, a bonnet is the lowest flat thing that is seen.
        rise: it lies no higher above the ground at the sensor than this share of these heights,
        slope: or this share of its range.
    """

    range_m: float = 80.0
    nearest_m: float = 2.0
    cell_m: float = 2.0
    below_m: float = 1.0
    steepest: float = 0.3
    reflected: float = 0.001
    beside: float = 4.0
    rise: float = 0.25
    slope: float = 0.1


@dataclass(frozen=True)
class ClusterConfig:
    """What hangs together in one scan (`clusters.py`).

    Attributes:
        range_m: horizontally; beyond it a car has hardly 100 points.
        lowest_m: above the ground; lower points join neighbours through kerbs and grass.
        highest_m: above the ground; higher points join vehicles through trees.
        reach_m: points nearer than this at the sensor hang together.
        reach_per_m: it grows by so much a metre of range, as beams spread.
        upright: heights count by this factor: beams are farther apart upwards than sideways.
        finer: clusters too large for a vehicle are cut apart with the reach times each of these.
        overhang_m: above the ground; what is higher and reaches out over the rest is no part of it.
        beyond_m: so far.
        beyond: with this share of its points.
        thin: points are thinned to this share of the reach before it is measured.
        fewest_points: of a cluster; 16 are the least that can be completed.
        lowest_top_m: above the ground; lower things are no vehicles.
        highest_bottom_m: above the ground; higher things do not stand on it.
        shortest_m: a car's width, half hidden.
        longest_m: a bus.
        widest_m: a truck with its mirrors.
    """

    range_m: float = 60.0
    lowest_m: float = 0.1
    highest_m: float = 3.5
    reach_m: float = 0.3
    reach_per_m: float = 0.01
    upright: float = 0.5
    finer: tuple[float, ...] = (0.6, 0.4)
    overhang_m: float = 2.0
    beyond_m: float = 0.3
    beyond: float = 0.15
    thin: float = 0.25
    fewest_points: int = 30
    lowest_top_m: float = 0.6
    highest_bottom_m: float = 1.0
    shortest_m: float = 1.0
    longest_m: float = 18.0
    widest_m: float = 3.5


@dataclass(frozen=True)
class DetectionConfig:
    """What belongs to a box that a detector found (`detections.py`).

    Attributes:
        around_m: points so far around a box are taken, too: detectors' boxes are a little off.
        fewest_points: of a box; 16 are the least that can be completed.
        shared: of boxes without tracks one goes if surer ones hold more of its points than this.
    """

    around_m: float = 0.2
    fewest_points: int = 16
    shared: float = 0.5


@dataclass(frozen=True)
class LinkConfig:
    """Which clusters of successive scans are one object (`tracks.py`). A tick is a scan's time.

    Attributes:
        gate_m: an object is looked for so far around where it is expected.
        first_gate_m: the same of one that was seen once, whose speed is not known: 30 m/s at 10 Hz.
        gate_per_tick_m: and so much farther for each tick that it was not seen.
        longest_gap: ticks after which an object that was not seen is given up.
        size_weight: metres of distance that a metre of change in size counts.
        velocity_gain: share of a new velocity that is believed.
        fewest_scans: shorter tracks are left out.
        usual_s: from a scan to the next, for which the gates are made.
        slow: from so many times as much on, clusters left over are looked for again, with gates
            that are wider by as much.
        traffic: of the sensor's own speed, which others may have; past `slow` it widens them, too.
        widest: the gates grow by no more.
        like_m: and only among clusters whose size differs by less.
    """

    gate_m: float = 1.5
    first_gate_m: float = 3.0
    gate_per_tick_m: float = 0.1
    longest_gap: int = 4
    size_weight: float = 0.15
    velocity_gain: float = 0.3
    fewest_scans: int = 4
    usual_s: float = 0.1
    slow: float = 1.5
    traffic: float = 2.0
    widest: float = 3.0
    like_m: float = 1.0

    def wider(self, scan_s: float | None, step_m: float = 0.0) -> float:
        """How much wider the second gates are, 1 where there are none.

        Args:
            scan_s: from a scan to the next, seconds, if known.
            step_m: that the sensor goes meanwhile.
        """
        times = 1.0 if scan_s is None else scan_s / self.usual_s
        times = max(times, self.traffic * step_m / self.first_gate_m)
        return 1.0 if times < self.slow else min(times, self.widest)


@dataclass(frozen=True)
class StandConfig:
    """Which tracks are one object that stands (`static_tracks.py`).

    Attributes:
        frames: of a track that tell where it stood, spread over it, at most.
        points: of each of them, at most.
        strays: share of them that do not count at each side.
        longest_m: a track's points together are no longer than a car, or it is not asked.
        widest_m: nor wider.
        overlap: share of the smaller rectangle that two of one object have in common.
        together: frames in which two pieces of one object may be seen.
    """

    frames: int = 30
    points: int = 50
    strays: float = 0.02
    longest_m: float = 6.0
    widest_m: float = 2.5
    overlap: float = 0.5
    together: int = 2


@dataclass(frozen=True)
class DriveConfig:
    """Everything that decides what a drive gives besides the checkpoint.

    Attributes:
        rays: those beside each vehicle are written into its track, too. The others: of each stage.
    """

    mounting: MountingConfig = field(default_factory=MountingConfig)
    trajectory: TrajectoryConfig = field(default_factory=TrajectoryConfig)
    ground: GroundConfig = field(default_factory=GroundConfig)
    clusters: ClusterConfig = field(default_factory=ClusterConfig)
    detections: DetectionConfig = field(default_factory=DetectionConfig)
    tracks: LinkConfig = field(default_factory=LinkConfig)
    standing: StandConfig = field(default_factory=StandConfig)
    completion: CompletionConfig = field(default_factory=CompletionConfig)
    driving: DrivingConfig = field(default_factory=DrivingConfig)
    deskewing: DeskewConfig = field(default_factory=DeskewConfig)
    turns: TurnConfig = field(default_factory=TurnConfig)
    vehicles: VehicleConfig = field(default_factory=VehicleConfig)
    own_vehicle: OwnVehicleConfig = field(default_factory=OwnVehicleConfig)
    merging: MergeConfig = field(default_factory=MergeConfig)
    association: AssociationConfig = field(default_factory=AssociationConfig)
    surroundings: SurroundingsConfig = field(default_factory=SurroundingsConfig)
    boxes: BoxConfig = field(default_factory=BoxConfig)
    rays: bool = False
