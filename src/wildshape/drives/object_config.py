# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The numbers of the stages that complete objects and tell vehicles; see `drives/config.py`."""

from dataclasses import dataclass


@dataclass(frozen=True)
class CompletionConfig:
    """Which scans of a track are completed (`completion.py`).

    Attributes:
        looks: scans of a track that the network sees first, the fullest of equal parts of those to
            complete.
        worst_cost_m: tracks whose best look costs more are no vehicles.
        hopeless_cost_m: nor are those whose fullest scan costs more.
        solid_scans: seen in so many scans with points as long, wide and high as a vehicle's, an
            object may cost more.
        solid_cost_m: but no more than this.
        least_nats: nor those whose looks say less on average, the fuller the heavier. No whole
            vehicle of three streets said less than -1.9, though fragments may; half of all else do.
        doubtful_nats: of those whose looks say less no other scans are completed. Of lorries from
            behind they say -2.6.
        worst_nats: no single look says less.
        scans: of a track that are completed together; more of a long one.
        ticks: between them; neighbours at 10 Hz are nearly the same scan.
        most_ticks: between them, of a long track: between scans that are farther apart nobody knows
            how it braked or turned.
        most_scans: of any track.
        fewest_points: scans of fewer are not completed where others are fuller.
        rays: whole tracks are put together with the rays beside the object.
    """

    looks: int = 3
    worst_cost_m: float = 0.26
    hopeless_cost_m: float = 0.4
    solid_scans: int = 15
    solid_cost_m: float = 0.35
    least_nats: float = -4.0
    doubtful_nats: float = -3.0
    worst_nats: float = -6.0
    scans: int = 16
    ticks: int = 4
    most_ticks: int = 8
    most_scans: int = 64
    fewest_points: int = 60
    rays: bool = True


@dataclass(frozen=True)
class DrivingConfig:
    """What drives by its points alone (`driving.py`), and is completed whatever a look says of it.

    Attributes:
        fewest_scans: of those to complete.
        way_m: that it gets.
        m_per_tick: how fast, at least: 3 m/s at 10 Hz.
        steady: in each step it goes ahead by more than this share of its speed.
        tall_m: in the middle one of its scans.
    """

    fewest_scans: int = 3
    way_m: float = 5.0
    m_per_tick: float = 0.3
    steady: float = 0.3
    tall_m: float = 1.0


@dataclass(frozen=True)
class VehicleConfig:
    """Which completed tracks are vehicles (`vehicles.py`).

    Where the weights state no probability, what speaks for a vehicle is added up as log-odds. The
    numbers were chosen by looking at two unlabelled drives, and at twenty simulated streets.

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
        least_driving: no object of a smaller one is made surer by a short way. On 58 streets four
            of 0.17 to 0.35 seemed to drive, and none was a vehicle.
        driving_m: what gets so far drives if it looks the way it goes.
        far_m: what gets so far drives, too, if it is not less likely than `least_far`: on 60
            streets all such were vehicles.
        least_far: see there.
        far_sides_m: and if it is seen as long, or as wide, as that: cyclists are not.
        driving_deg: to so many degrees.
        driving_kind: the probability of those that drive is at least this.
        driving_confidence: and so is what is stated of them: their heading is known.
        length_m: from and to.
        width_m: from and to.
        height_m: from and to.
        tall_m: what is higher, up to this, is a vehicle only if that is sure enough: walls of
            houses are as high.
        tall_kind: so sure.
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
    least_driving: float = 0.4
    driving_m: float = 3.5
    far_m: float = 10.0
    least_far: float = 0.05
    far_sides_m: tuple[float, float] = (2.5, 1.2)
    driving_deg: float = 15.0
    driving_kind: float = 0.9
    driving_confidence: float = 0.5
    length_m: tuple[float, float] = (2.5, 12.0)
    width_m: tuple[float, float] = (1.4, 3.2)
    height_m: tuple[float, float] = (1.05, 3.6)
    tall_m: float = 4.0
    tall_kind: float = 0.7
    fewest_points: int = 60


@dataclass(frozen=True)
class OwnVehicleConfig:
    """What is a part of the vehicle that carries the sensor (`own_vehicle.py`).

    Attributes:
        way_m: that the sensor goes meanwhile; less tells it from no standing neighbour.
        near_m: it begins no farther beyond the nearest points that are kept: a ring or two.
        stays_m: it stays so near to one place as the sensor sees it; who drives beside it does not.
        most: share of the scans in which it does.
    """

    way_m: float = 5.0
    near_m: float = 0.3
    stays_m: float = 0.3
    most: float = 0.8


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
class AssociationConfig:
    """Which clusters belong to a vehicle that was found (`cluster_association.py`).

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
class SurroundingsConfig:
    """What is too crowded for a vehicle (`surroundings.py`).

    Cars stand beside hedges, so this is asked of doubtful ones alone. The numbers were chosen by
    looking at two unlabelled drives.

    Attributes:
        sure: vehicles that are surer are not asked.
        near_m: of a box; points so near are its own.
        far_m: of a box's sides and ends; points so near are close around it.
        low_m: above the box's floor; lower ones may be ground.
        share: of the box's own points, from which those around it are too many.
    """

    sure: float = 0.4
    near_m: float = 0.15
    far_m: float = 0.6
    low_m: float = 0.4
    share: float = 0.08


@dataclass(frozen=True)
class DeskewConfig:
    """How scans of what drives are carried to one time (`deskewing.py`).

    Attributes:
        least_m_per_s: what is slower stands: the middle of what is seen of it moves, too.
        smooth_s: over which its speed is taken, standard deviation.
    """

    least_m_per_s: float = 2.5
    smooth_s: float = 0.5


@dataclass(frozen=True)
class TurnConfig:
    """Which way the beam turns (`rolling_shutter.py`).

    Attributes:
        fewest_scans: completed, of an object that is asked.
        standing_m: one that is nearer than this to its middle place stands.
        clearer: those that stand must be nearer to it than without a turn by this factor.
        half_clearer: the same of turns that take half of the time between scans. Every second scan
            of a street and of a real drive: 0.36 and 0.51; all of a short one: 0.75 and more.
    """

    fewest_scans: int = 4
    standing_m: float = 0.3
    clearer: float = 0.9
    half_clearer: float = 0.65


@dataclass(frozen=True)
class BoxConfig:
    """How boxes are smoothed in time (`boxes.py`).

    Attributes:
        moving_m: an object that gets farther ahead or back than this through its track may be
            moving.
        moving_m_per_tick: and it must be as fast as this: 0.5 m/s at 10 Hz.
        moving_scans: or through so many successive ones of its completed scans.
        heading_m_per_tick: only scans in which an object is as fast as this tell which end is its
            front: 1 m/s at 10 Hz.
        smooth_ticks: over which the way of a moving object is smoothed, standard deviation.
        stray_m: completed scans that lie this far from the way of those around are left out.
        stray_ticks: around, standard deviation.
        longest_gap: ticks in which a vehicle was not seen and still has boxes.
        ground_gap_m: boxes that end so near the ground, above or below, end there.
        ground_ticks: in each frame a box's height above the ground is the middle one of those up
            to so many ticks before and after it.
        ground_stray_m: ground so far from what is usual around it is a part of a vehicle, by its
            height in the world and by that of the box above it.
        ground_stray_ticks: around, before and after.
    """

    moving_m: float = 1.0
    moving_m_per_tick: float = 0.05
    moving_scans: int = 6
    heading_m_per_tick: float = 0.1
    smooth_ticks: float = 3.0
    stray_m: float = 0.6
    stray_ticks: float = 8.0
    longest_gap: int = 10
    ground_gap_m: float = 1.0
    ground_ticks: int = 2
    ground_stray_m: float = 0.3
    ground_stray_ticks: int = 12
