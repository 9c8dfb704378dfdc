# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The true boxes of a simulated drive as other people's detectors write theirs."""

import json
import math
from dataclasses import replace

import torch

from wildshape.drives.tracking.detections import DetectionFile
from wildshape.geometry.transforms.rotation import quaternion_from_rotation
from wildshape.io.boxes.detections import Detection
from wildshape.io.boxes.kitti import camera_at_the_lidar, write_kitti_labels
from wildshape.io.boxes.nuscenes import write_nuscenes_boxes
from wildshape.records import Box


def true_boxes(street):
    """Frame and true box, and that box as our writers take it."""
    for frame, scan in enumerate(street.scans):
        for true in scan.boxes:
            T = torch.from_numpy(true.T_sensor_object)
            x, y, z = T[:3, 3].tolist()
            qw, qx, qy, qz = quaternion_from_rotation(T[:3, :3]).tolist()
            box = Box((x, y, z), true.size, (qw, qx, qy, qz))
            name = f"{true.track:04d}"
            scan_name = street.drive.scan_names[frame]
            yield (
                frame,
                true,
                Detection(name, true.track, scan_name, frame, true.kind, "lidar", 0.5, box),
            )


def rows_of(street, frame):
    """Each true box of a frame as x, y, z, length, width, height, yaw; and their kinds."""
    found = []
    for at, true, one in true_boxes(street):
        if at == frame:
            T = true.T_sensor_object
            yaw = math.atan2(T[1, 0], T[0, 0])
            found.append(([*one.box.centre, *one.box.size, yaw], true.kind))
    return [row for row, _ in found], [kind for _, kind in found]


def kitti_tracking(street, folder):
    del folder
    return DetectionFile(street.root / "label_02" / "0000.txt", street.root / "calib" / "0000.txt")


def kitti_objects(street, folder):
    """A file a scan, without tracks, with scores."""
    lines = (street.root / "label_02" / "0000.txt").read_text().splitlines()
    for frame, name in enumerate(street.drive.scan_names):
        own = [line.split()[2:] for line in lines if int(line.split()[0]) == frame]
        text = "".join(" ".join([*words, "0.9"]) + "\n" for words in own)
        (folder / f"{name}.txt").write_text(f"{text}DontCare -1 -1 -10 0 0 0 0 {'-1 ' * 7}\n")
    return DetectionFile(folder, street.root / "calib" / "0000.txt")


def our_kitti(street, folder):
    """As `--boxes kitti` writes: a file a track, the camera at the LiDAR's place."""
    detections = [one for _, _, one in true_boxes(street)]
    detections = [
        replace(one, category="car") for one in detections if one.category != "Pedestrian"
    ]
    write_kitti_labels(folder, detections, camera_at_the_lidar())
    return DetectionFile(folder)


def our_nuscenes(street, folder):
    detections = [one for _, _, one in true_boxes(street)]
    write_nuscenes_boxes(folder / "nuscenes.json", detections)
    return DetectionFile(folder / "nuscenes.json")


def nuscenes_detection(street, folder):
    path = our_nuscenes(street, folder).path
    said = json.loads(path.read_text())
    for rows in said["results"].values():
        for row in rows:
            for key in ("tracking_id", "tracking_name", "tracking_score"):
                del row[key]
    path.write_text(json.dumps(said))
    return DetectionFile(path)


def openpcdet(street, folder):
    scans = []
    for frame, name in enumerate(street.drive.scan_names):
        boxes, names = rows_of(street, frame)
        scores = [0.7] * len(boxes)
        one = {
            "name": names,
            "score": scores,
            "boxes_lidar": boxes,
            "pred_labels": [1] * len(boxes),
        }
        scans.append({**one, "frame_id": f"samples/LIDAR_TOP/{name}.bin"})
    (folder / "result.json").write_text(json.dumps(scans))
    return DetectionFile(folder / "result.json")


def mmdetection3d(street, folder):
    """A file a scan; z is that of the floor, and velocities follow the yaw."""
    for frame, name in enumerate(street.drive.scan_names):
        boxes, names = rows_of(street, frame)
        low = [[x, y, z - h / 2, n, w, h, yaw, 0, 0] for x, y, z, n, w, h, yaw in boxes]
        said = {"bboxes_3d": low, "scores_3d": [0.7] * len(low), "labels_3d": names}
        (folder / f"{name}.json").write_text(json.dumps({**said, "box_type_3d": "LiDAR"}))
    return DetectionFile(folder)


def table(street, folder):
    del folder
    return DetectionFile(street.root / "truth" / "0000.csv")


TRACKED = (kitti_tracking, our_kitti, our_nuscenes, table)
UNTRACKED = (kitti_objects, nuscenes_detection, openpcdet, mmdetection3d)
