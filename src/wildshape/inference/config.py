# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The numbers that decide what comes out of a trained network, in frozen records.

They are written into every result (`objects.json`) and can be set from Python:
`wildshape.load(config=InferenceConfig(refine=RefineConfig(iterations=0)))`. Lengths of `refine`,
`track`, `box` and `free_space` are for objects of five metres or more; for smaller ones they shrink
with the object.
"""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class HypothesisRule:
    """Which pose hypothesis speaks, and when a scan is looked at again.

    Attributes:
        upright_rad: a scan whose object comes out rolled by more than this is looked at again.
            Networks see upright scans best.
    """

    upright_rad: float = 0.1


@dataclass(frozen=True)
class RefineConfig:
    """How one completion is fitted to its scan (`refine.py`).

    Attributes:
        iterations: Gauss-Newton steps; 0 leaves pose and size as the network says.
        matched_at: the steps before which correspondences are found anew.
        plane_points: points of the shape that make the plane around a scan point.
        scan_points: points of the scan that are used.
        effective_points: scan points err together, because the shape errs: as much is believed as
            if there were so many.
        error_m: how far a scan point lies off the shape.
        kernel_m: width of the robust kernel (Geman-McClure).
        prior_deg: how far off the network's rotation is taken to be.
        prior_m: the same of its translation.
        prior_stretch: the same of its size, a share.
        level_deg: how level a LiDAR on a vehicle is held.
        tilted_deg: beyond this a sensor is taken for tilted on purpose; width of a robust kernel.
        level_may_cost: by which factor the fit may be worse where a sensor was brought level.
        reach_m: how far around a point of the shape the scan is looked for.
        stiffness: weight of the point itself against what was seen around it.
        drawn_by: most points of the scan that draw one of the shape.
        voxel_m: the scan is thinned to this.
        partner: each point of a refined shape gets another, in the middle between it and this many
            neighbours away: those of a decoder lie unevenly, and middles with the nearest ones
            would fall where there are enough.
        seen_voxel_m: points of a LiDAR's scans, thinned to this, stand in for as many middles.
        seen_near_m: those that are farther from all of the network's points do not.
    """

    iterations: int = 6
    matched_at: tuple[int, ...] = (0, 2, 4)
    plane_points: int = 8
    scan_points: int = 512
    effective_points: float = 300.0
    error_m: float = 0.07
    kernel_m: float = 0.3
    prior_deg: float = 3.0
    prior_m: float = 0.05
    prior_stretch: float = 0.08
    level_deg: float = 1.0
    tilted_deg: float = 5.0
    level_may_cost: float = 1.1
    reach_m: float = 0.12
    stiffness: float = 0.2
    drawn_by: int = 8
    voxel_m: float = 0.08
    partner: int = 5
    seen_voxel_m: float = 0.07
    seen_near_m: float = 0.15


@dataclass(frozen=True)
class JointIcpConfig:
    """How the poses of a track are fitted to each other (`tracks/joint_icp.py`).

    Attributes:
        rounds: each moves every scan once.
        points: of each scan that are used.
        most: points of all scans together that are used.
        widest_m: width of the robust kernel at first.
        narrower: it narrows by this factor a round.
        narrowest_m: at last.
        normal_points: around each point, from which its normal is taken.
        normal_rounds: after so many rounds normals are taken anew.
        holding: how much a point is held in every direction, against sliding; of its normal's 1.
        step: share of a Gauss-Newton step that is taken.
        ridge: damping of a step, a share of the points' weight; a scan of few sides is not moved
            along what it does not see.
    """

    rounds: int = 7
    points: int = 128
    most: int = 8192
    widest_m: float = 0.5
    narrower: float = 0.65
    narrowest_m: float = 0.06
    normal_points: int = 24
    normal_rounds: int = 4
    holding: float = 0.1
    step: float = 0.8
    ridge: float = 1e-3


_FINE = JointIcpConfig(rounds=12, points=512, normal_rounds=6, widest_m=0.2, holding=0.02)
_ONTO = JointIcpConfig(points=256)


@dataclass(frozen=True)
class HeadingVoteConfig:
    """How the scans of a track agree on which way is front (`tracks/heading_vote.py`).

    Attributes:
        neighbours: scans on either side that are compared; each one more doubles the time.
        own_alike: what a scan found for itself weighs as so many neighbours posed alike, times
            -log(1 - p) of being right: a sensor may turn a corner, or pass by, between two scans.
        own_most: no scan weighs as one with a larger logarithm.
        slow_deg: tracks of which three quarters of the neighbours turn by less follow each other.
        far_m: misfits count no further than this.
        same_side_m: two scans that lie worse on each other than this see different sides.
        shape_votes: weight of the track's mean shape in the vote.
        own_m: weight of what a scan found for itself, metres of cost at confidence 1.
        unsure: confidence that is added to every scan's own.
        near_m: largest weight of where the next sensor stood, metres of cost.
        leap: a sensor that moved by this share of its distance says 1/e as much.
    """

    neighbours: int = 5
    own_alike: float = 0.2
    own_most: float = 5.0
    slow_deg: float = 15.0
    far_m: float = 0.4
    same_side_m: float = 0.1
    shape_votes: float = 2.0
    own_m: float = 0.05
    unsure: float = 0.1
    near_m: float = 1.0
    leap: float = 0.7


@dataclass(frozen=True)
class PoseOutlierConfig:
    """Which scans' poses no neighbour shares (`tracks/pose_outliers.py`).

    Attributes:
        alike_deg: neighbours that differ by less agree.
        apart_deg: a scan that differs from both by more is an outlier.
        worse_m: it stays if the shape of the track costs so much more between its neighbours, for
            a sensor that passes close by sees an object turn fast.
        misfit: nor is it one if the shape costs no more than so many times what it usually does.
        less_sure: a run of scans against a surer one is wrong if it is less sure than this share.
        leap_s: within so many seconds no vehicle turns by `apart_deg`.
        unseen_s: scans in a row that are farther apart tell nothing of it.
    """

    alike_deg: float = 25.0
    apart_deg: float = 45.0
    worse_m: float = 0.5
    misfit: float = 1.5
    less_sure: float = 0.75
    leap_s: float = 2.0
    unseen_s: float = 1.0


@dataclass(frozen=True)
class TrackConfig:
    """How all scans of a track make one object (`tracks/complete_track.py`).

    Attributes:
        coarse: first fit of the poses to each other.
        fine: the fit that goes on from it.
        key_scans: of a longer track so many, evenly spread, two at least, are fitted to each
            other; with the points of more the fits are worse.
        onto: fit of each other scan to the key scans.
        believed: scans whose odds are this share of the best are among the surest.
        within_m: fits that move a pose farther are not believed.
        within_rad: fits that turn a pose farther are not believed.
        most_points: of all scans, fused.
        shown_points: of all scans, those that can stand in for middles (`RefineConfig`).
        voting_points: of each scan, where views are laid on each other.
        voxel_m: the fused scans are thinned to this.
        reach_m: how far around a point of the shape the fused scans are looked for.
        stiffness: weight of the point itself against what was seen around it.
        drawn_by: most of the fused points that draw one of the shape.
    """

    vote: HeadingVoteConfig = field(default_factory=HeadingVoteConfig)
    outliers: PoseOutlierConfig = field(default_factory=PoseOutlierConfig)
    coarse: JointIcpConfig = field(default_factory=JointIcpConfig)
    fine: JointIcpConfig = _FINE
    key_scans: int = 32
    onto: JointIcpConfig = _ONTO
    believed: float = 0.2
    within_m: float = 1.5
    within_rad: float = 0.6
    most_points: int = 4096
    shown_points: int = 32_768
    voting_points: int = 192
    voxel_m: float = 0.08
    reach_m: float = 0.12
    stiffness: float = 0.2
    drawn_by: int = 8


@dataclass(frozen=True)
class BoxConfig:
    """How a box is laid around a shape (`boxes.py`).

    Attributes:
        shape_share: share of the shape's points that do not count at each end and side.
        hidden_share: the same at a front or rear end before which the scans ended: what a decoder
            puts there is spread over where such ends may be.
        near_m: scans that come so near to an end saw it.
        unknown_m: of scans that ended so far before it something else hid the rest, and a decoder
            makes that too short as often as too long.
        seen_share: of a scan's points, those that do not count.
        ground_share: of its points those that lie lower than this share of the shape's height are
            no ends and sides: they may be ground.
        strays: the shape's highest and lowest points that do not count; at least as many do not at
            its ends and sides.
        reach: share of the box's diagonal by which a scan may reach beyond the shape and is
            believed.
        scans_a_witness: of so many scans the one that reaches furthest is not believed.
        level_deg: largest turn about y that levels a vehicle's shape in its frame.
        step_deg: of that turn.
        tipped_deg: the same of depth views, whose canonical frame may have any pitch: that of the
            shipped chairs has 23 degrees.
        tipped_gain: it makes their side view's rectangle smaller by this share at least: of chairs
            by 0.2 to 0.5, of airplanes, for their fins, by up to 0.2 where nothing is tipped.
    """

    shape_share: float = 0.01
    hidden_share: float = 0.02
    near_m: float = 0.2
    unknown_m: float = 1.0
    seen_share: float = 0.03
    ground_share: float = 0.15
    strays: int = 2
    reach: float = 0.08
    scans_a_witness: int = 4
    level_deg: float = 4.0
    step_deg: float = 0.25
    tipped_deg: float = 45.0
    tipped_gain: float = 0.2


@dataclass(frozen=True)
class FreeSpaceConfig:
    """How the rays of a frame are held against a shape (`free_space.py`).

    Attributes:
        nearest: rays that pass a point nearest and must agree; 0: rays are not used.
        within_m: rays that pass farther away say nothing of a point.
        beyond_m: a ray passed a point, or ended before it, by at least this.
        free_m: a hypothesis costs this times the share of its shape that stands in free space.
        low_m: points so little above a shape's lowest one are never taken out of it.
        least_kept: a shape of which less than this share would be left stays as it is.
    """

    nearest: int = 3
    within_m: float = 0.15
    beyond_m: float = 0.1
    free_m: float = 0.5
    low_m: float = 0.4
    least_kept: float = 0.5


@dataclass(frozen=True)
class ReasonRule:
    """When a result is flagged as not to be trusted (`confidence.py`).

    Attributes:
        few_points: a scan of fewer points says little: twice what is accepted at least.
        smallest: share of the smallest extent trained on, below which a scan is too small.
        largest: times the largest extent trained on, above which a warning is given.
        poor_fit: times the 90th percentile of the held-out label-free cost.
        low_confidence: of weights without probabilities: one chance in ten that the completion is
            as good as the median of those calibrated on.
        least: a probability, or the product of all three, below which it is rather wrong.
        disagree: share of their median by which the heights that a track's scans have, each
            completed on its own, may differ from the 20th to the 80th percentile. It was 0.07 at
            most on 35 tracks of one object, and 0.27 on 74 half-hidden ones, 4 % of which lie above
            this. Of mixtures of two vehicles 0.3 m apart in height all 10 do, and 24 of 25
            half-hidden ones.
        apart_m: what lies so far from a shape is no part of it; of a vehicle, smaller objects as
            much less.
        off_share: share of a scan that may lie off its shape. Of 1,148 clean scans none had more.
        alike_deg: two points so near each other in direction were not met by one turn of a sensor.
        twice_share: share of a scan that may have another range in its direction. Of the same
            scans none had more.
    """

    few_points: int = 32
    smallest: float = 0.5
    largest: float = 1.5
    poor_fit: float = 1.5
    low_confidence: float = 0.1
    least: float = 0.5
    disagree: float = 0.2
    apart_m: float = 0.5
    off_share: float = 0.015
    alike_deg: float = 0.06
    twice_share: float = 0.01


@dataclass(frozen=True)
class InlierRule:
    """Which points of a registered source lie on its target.

    Attributes:
        within_m: nearest target points are no farther; the noise of scans and their spacing.
        within_share: nor than this share of the target's extent.
    """

    within_m: float = 0.2
    within_share: float = 0.05


@dataclass(frozen=True)
class ExportRule:
    """How near an exported file must come to torch (`export/verify.py`).

    Attributes:
        largest_m: of any coordinate of any completed point, of the pose, the cost and the
            confidence: float32 of another runtime.
        other_share: of the scans that may be given another pose that costs as much, or another cost
            or confidence: rounding may move a point over the border of a bin.
    """

    largest_m: float = 1e-4
    other_share: float = 0.1


@dataclass(frozen=True)
class InferenceConfig:
    """Everything that decides a result besides the checkpoint.

    Attributes:
        ground_share: a scan of which more than this share is ground beside the object is given to
            the network once more without it.
    """

    hypothesis: HypothesisRule = field(default_factory=HypothesisRule)
    refine: RefineConfig = field(default_factory=RefineConfig)
    track: TrackConfig = field(default_factory=TrackConfig)
    box: BoxConfig = field(default_factory=BoxConfig)
    free_space: FreeSpaceConfig = field(default_factory=FreeSpaceConfig)
    reasons: ReasonRule = field(default_factory=ReasonRule)
    inliers: InlierRule = field(default_factory=InlierRule)
    ground_share: float = 0.05
