# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The numbers that decide what `drive` finds, in frozen records, a record a stage.

They are written into `wildshape.json` of every result and can be set from Python:
`wildshape.drive("recording", "found", DriveConfig(clusters=ClusterConfig(range_m=40.0)))`.
"""

from dataclasses import dataclass, field

from wildshape.inference.config import InferenceConfig, JointIcpConfig, TrackConfig

INFERENCE = InferenceConfig(
    track=TrackConfig(
        coarse=JointIcpConfig(rounds=8),
        fine=JointIcpConfig(rounds=8, points=256, most=4096, holding=0.02),
    )
)
"""How `drive` completes objects: tracks in fewer rounds, of fewer points; boxes are as good."""


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
        object_m: scans that are smaller are of an object; the longest lorries are as long.
        level_deg: less tilt than this is the road's, not the sensor's, and is left alone.
    """

    scans: int = 9
    reach_m: float = 15.0
    trials: int = 300
    thick_m: float = 0.1
    steepest_deg: float = 35.0
    below: float = 0.03
    object_m: float = 20.0
    level_deg: float = 2.0


@dataclass(frozen=True)
class TrajectoryConfig:
    """How the sensor's way is found (`trajectory.py`), by KISS-ICP with its own other settings.

    Attributes:
        range_m: farthest points that are used.
        nearest_m: nearer ones are the vehicle that carries the sensor.
        ground_m: ground farther away is not used.
        standing_m: what is higher above the ground is.
        voxel_m: size of the local map's cells.
        settled: a scan has found its place when a step moves it by less, metres and radians.
        fits_m: points this near to one of the scan before fit it.
        least_fit: a scan of which a smaller share fits the one before was taken elsewhere: the
            odometry begins anew. On real and simulated streets 0.87 and more fit, of scans taken
            elsewhere 0.26 to 0.48.
        jump_m: steps of neighbouring scans that differ by more are counted as a jump. At 10 Hz no
            vehicle changes its speed by 20 m/s in between.
    """

    range_m: float = 100.0
    nearest_m: float = 2.0
    ground_m: float = 10.0
    standing_m: float = 0.2
    voxel_m: float = 0.75
    settled: float = 1e-3
    fits_m: float = 1.0
    least_fit: float = 0.65
    jump_m: float = 2.0


@dataclass(frozen=True)
class GroundConfig:
    """What is ground (`ground.py`), by Patchwork++ with its own other settings.

    Attributes:
        range_m: farther points are neither ground nor object.
        nearest_m: nearer points are the vehicle that carries the sensor.
        cell_m: the ground's height is kept in cells of this size: over more of it roads slope.
    """

    range_m: float = 80.0
    nearest_m: float = 2.0
    cell_m: float = 2.0


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
    """

    around_m: float = 0.2
    fewest_points: int = 16


@dataclass(frozen=True)
class LinkConfig:
    """Which clusters of successive scans are one object (`tracks.py`). A tick is a scan's time.

    Attributes:
        gate_m: an object is looked for so far around where it is expected.
        gate_per_tick_m: and so much farther for each tick that it was not seen.
        longest_gap: ticks after which an object that was not seen is given up.
        size_weight: metres of distance that a metre of change in size counts.
        velocity_gain: share of a new velocity that is believed.
        fewest_scans: shorter tracks are left out.
    """

    gate_m: float = 1.5
    gate_per_tick_m: float = 0.1
    longest_gap: int = 4
    size_weight: float = 0.15
    velocity_gain: float = 0.3
    fewest_scans: int = 4


@dataclass(frozen=True)
class CompletionConfig:
    """Which scans of a track are completed (`completion.py`).

    Attributes:
        looks: scans of a track that the network sees first, the fullest of equal parts of those to
            complete.
        worst_cost_m: tracks whose best look costs more are no vehicles; those of a labelled street
            cost less than 0.2 m.
        hopeless_cost_m: nor are those whose fullest scan costs more.
        hopeless_nats: nor those whose fullest scan says less for a vehicle.
        least_nats: nor those whose looks say less on average, the fuller the heavier. No whole
            vehicle of three streets said less than -1.9, though fragments may; half of all else do.
        doubtful_nats: of those whose looks say less no other scans are completed.
        worst_nats: no single look says less.
        scans: of a track that are completed together.
        ticks: between them; neighbours at 10 Hz are nearly the same scan.
        fewest_points: scans of fewer are not completed where others are fuller.
    """

    looks: int = 3
    worst_cost_m: float = 0.2
    hopeless_cost_m: float = 0.22
    hopeless_nats: float = -5.0
    least_nats: float = -4.0
    doubtful_nats: float = -2.0
    worst_nats: float = -6.0
    scans: int = 16
    ticks: int = 4
    fewest_points: int = 60


@dataclass(frozen=True)
class VehicleConfig:
    """Which completed tracks are vehicles (`vehicles.py`).

    Where the weights state no probability, what speaks for a vehicle is added up as log-odds. The
    numbers were chosen by looking at two unlabelled drives.

    Attributes:
        kinds: usual length, width, height of cars, vans and lorries, metres.
        spread: share of these by which they vary.
        even_cost_m: a label-free cost that speaks neither for nor against a vehicle.
        cost_scale_m: a nat for so much less.
        usual_scans: a track of more scans speaks for a vehicle.
        sure_of_parts: several tracks put together that are surer than this come before their
            parts.
        merged_nats: what several tracks of one shape in one place say for a vehicle.
        usual_confidence: of the completions; more speaks for a vehicle.
        least_confidence: objects of less are left out.
        least_kind: the same where the weights state the probability.
        length_m: from and to.
        width_m: from and to.
        height_m: from and to.
        fewest_points: that the fullest scan must have.
    """

    kinds: tuple[tuple[float, float, float], ...] = (
        (4.3, 1.9, 1.55),
        (5.4, 2.2, 2.3),
        (7.0, 2.5, 3.1),
    )
    spread: float = 0.15
    even_cost_m: float = 0.15
    cost_scale_m: float = 0.03
    usual_scans: int = 8
    sure_of_parts: float = 0.6
    merged_nats: float = 1.0
    usual_confidence: float = 0.1
    least_confidence: float = 0.4
    least_kind: float = 0.5
    length_m: tuple[float, float] = (2.5, 9.0)
    width_m: tuple[float, float] = (1.4, 3.2)
    height_m: tuple[float, float] = (1.05, 3.6)
    fewest_points: int = 60


@dataclass(frozen=True)
class MergeConfig:
    """Which tracks are one object by their complete shapes (`merging.py`).

    Attributes:
        least_confidence: objects that are hardly vehicles are not asked.
        overlap: share of the smaller footprint that one object's shapes have in common.
        apart: objects that share less than this are beside each other.
        beyond_ticks: a moving object is expected so long before and after it was seen; a standing
            one always.
    """

    least_confidence: float = 0.05
    overlap: float = 0.3
    apart: float = 0.1
    beyond_ticks: int = 15


@dataclass(frozen=True)
class ClaimConfig:
    """Which clusters belong to a vehicle that was found (`claims.py`).

    Attributes:
        around_m: of its box; points so near belong to it.
        inside: share of a cluster's points that must.
        lost: a vehicle that surer ones take so much of its scans from is a part of them.
        beyond_ticks: a moving vehicle is looked for so long before and after it was seen.
    """

    around_m: float = 0.2
    inside: float = 0.8
    lost: float = 0.5
    beyond_ticks: int = 5


@dataclass(frozen=True)
class CarveConfig:
    """Where rays say that a vehicle ends (`carving.py`).

    Attributes:
        slab_m: a box is looked at in slabs of this thickness, from each end inwards.
        reach_m: so far inwards.
        low_m: above the box's floor; lower rays pass under a vehicle.
        high_m: above the box's floor; higher ones pass over a bonnet.
        strip_m: rays are counted in this depth behind the side that the sensor sees: less is a
            corner's rounding, of more nothing is seen.
        behind_m: a ray passes where it goes on so far.
        fewest_rays: through an empty slab.
        corner_m: a vehicle reaches so far beyond where a side seen begins to turn.
        far_corner_m: the same where the end itself looks away from the sensor.
        most_m: no end is moved farther: some vehicles have pointed ends.
        strays: share of a vehicle's points that may be left outside.
    """

    slab_m: float = 0.05
    reach_m: float = 0.6
    low_m: float = 0.3
    high_m: float = 1.0
    strip_m: tuple[float, float] = (0.15, 0.6)
    behind_m: float = 0.3
    fewest_rays: int = 3
    corner_m: float = 0.1
    far_corner_m: float = 0.25
    most_m: float = 0.25
    strays: float = 0.002


@dataclass(frozen=True)
class BoxConfig:
    """How boxes are smoothed in time (`boxes.py`).

    Attributes:
        moving_m: an object that gets farther than this through its track may be moving.
        moving_m_per_tick: and it must be as fast as this: 0.5 m/s at 10 Hz.
        heading_m_per_tick: an object as fast as this looks where it goes: 1 m/s at 10 Hz.
        smooth_ticks: over which the way of a moving object is smoothed, standard deviation.
        longest_gap: ticks in which a vehicle was not seen and still has boxes.
    """

    moving_m: float = 1.0
    moving_m_per_tick: float = 0.05
    heading_m_per_tick: float = 0.1
    smooth_ticks: float = 3.0
    longest_gap: int = 10


@dataclass(frozen=True)
class DriveConfig:
    """Everything that decides what a drive gives besides the checkpoint."""

    mounting: MountingConfig = field(default_factory=MountingConfig)
    trajectory: TrajectoryConfig = field(default_factory=TrajectoryConfig)
    ground: GroundConfig = field(default_factory=GroundConfig)
    clusters: ClusterConfig = field(default_factory=ClusterConfig)
    detections: DetectionConfig = field(default_factory=DetectionConfig)
    tracks: LinkConfig = field(default_factory=LinkConfig)
    completion: CompletionConfig = field(default_factory=CompletionConfig)
    vehicles: VehicleConfig = field(default_factory=VehicleConfig)
    merging: MergeConfig = field(default_factory=MergeConfig)
    claims: ClaimConfig = field(default_factory=ClaimConfig)
    carving: CarveConfig = field(default_factory=CarveConfig)
    boxes: BoxConfig = field(default_factory=BoxConfig)
