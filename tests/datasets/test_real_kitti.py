# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The published drive 0001, where it is at hand: reader, truth, baselines together."""

from pathlib import Path

import numpy as np
import pytest
from tests.cars import known

from wildshape.baselines.identity import Identity, OneScan
from wildshape.baselines.named import baseline
from wildshape.datasets.kitti.raw import KittiRaw
from wildshape.datasets.kitti.tracklets import read_tracklets
from wildshape.datasets.tracks.labelled_boxes import Crop, rows_in_box
from wildshape.datasets.tracks.selection import Selection
from wildshape.datasets.tracks.source import all_tracks
from wildshape.datasets.tracks.truth import fuse_by_truth, shape_mirrored
from wildshape.evaluation.protocol import run
from wildshape.evaluation.summary import figures_of

ROOT = Path(__file__).parents[2].parent / "shared" / "data" / "real" / "kitti_raw"
DRIVE = ROOT / "2011_09_26" / "2011_09_26_drive_0001_sync"
pytestmark = pytest.mark.skipif(
    not DRIVE.is_dir(), reason="KITTI raw drive 0001 is not in ../shared/data: not run"
)


@pytest.fixture(scope="module")
def tracks():
    return list(all_tracks(KittiRaw(ROOT)))


def test_twelve_cars_nine_with_enough_scans(tracks):
    source = KittiRaw(ROOT)
    assert len(list(all_tracks(source))) == 9
    assert source.rejected["object: fewer than 1 scans left"] == 3
    assert source.rejected["object: category Cyclist"] == 2
    assert source.rejected["object: category Tram"] == 1
    assert all(14 <= len(track.scans) <= 27 for track in tracks)
    assert min(len(scan) for track in tracks for scan in track.scans) >= 100


def test_cut_frames_hold_the_same_points_as_full_scans(tracks):
    from wildshape.datasets.kitti.raw import read_velodyne

    tracklet = read_tracklets(DRIVE / "tracklet_labels.xml")[0]
    for frame in range(5):
        full = read_velodyne(DRIVE / "velodyne_points" / "data" / f"{frame:010d}.bin")
        cut = read_velodyne(DRIVE / "velodyne_objects_xyz0" / f"{frame:010d}.bin")
        T = tracklet.T_velo_object[frame - tracklet.first_frame]
        a, b = (rows_in_box(cloud, T, tracklet.size, Crop()) for cloud in (full, cut))
        assert len(a) == pytest.approx(len(b), rel=0.02)


def test_accumulated_points_lie_on_the_labelled_boxes(tracks):
    tracklets = read_tracklets(DRIVE / "tracklet_labels.xml")
    for track in tracks:
        half = np.asarray(tracklets[int(track.name[-4:])].size) / 2
        local = np.abs(fuse_by_truth(track))
        inside = (local <= half + 0.05).all(axis=1)
        # A shell, not a filled box: most points near a side, front, back or the roof's slope.
        near = (half - local).min(axis=1) < 0.35
        assert inside.mean() > 0.9
        assert near.mean() > 0.8
        mirrored = shape_mirrored(track)
        extent = mirrored.max(axis=0) - mirrored.min(axis=0)
        assert extent[:2] == pytest.approx(2 * half[:2], abs=0.4)


def test_baselines_come_out_as_measured_before(tracks):
    """Every second scan, as recorded: identity 0.46 deg, 0.144 m, CD 0.188; ICP 1.75, 0.049, 0.157.

    Those were taken with another crop and truth density, hence the margins.
    """
    methods = {"identity": Identity(), "icp": baseline("local-icp"), "scan": OneScan()}
    results = run(methods, all_tracks(KittiRaw(ROOT, Selection(every=2))))
    identity, icp, scan = (known(figures_of(results[name])) for name in methods)
    assert identity["acc30"] == icp["acc30"] == 1
    assert identity["rot_median_deg"] == pytest.approx(0.46, abs=0.1)
    assert identity["trans_median_m"] == pytest.approx(0.144, abs=0.02)
    assert identity["cd"] == pytest.approx(0.188, abs=0.02)
    assert icp["rot_median_deg"] == pytest.approx(1.75, abs=0.3)
    assert icp["trans_median_m"] == pytest.approx(0.049, abs=0.01)
    assert icp["cd"] == pytest.approx(0.157, abs=0.02)
    assert icp["cd"] < scan["cd"]
