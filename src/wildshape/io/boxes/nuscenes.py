# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Boxes as a results file of nuScenes: by sample, size as width, length, height."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from wildshape.io.atomic import write_json
from wildshape.io.boxes.detections import Detection

_META = {
    "use_camera": False,
    "use_lidar": True,
    "use_radar": False,
    "use_map": False,
    "use_external": False,
    "frame": "the scan's own sensor frame, not the global one: apply ego pose and calibration",
}
_UNKNOWN = "object"


def write_nuscenes_boxes(path: Path, detections: Sequence[Detection]) -> None:
    """Write one JSON object, `meta` and `results` by sample token, atomically.

    The token is the scan's name. A record has the fields of nuScenes' detection and tracking
    results. Velocity is 0 where it is not known.
    """
    results: dict[str, list[dict[str, Any]]] = {}
    for one in detections:
        results.setdefault(one.scan, []).append(_record(one))
    write_json(path, {"meta": _META, "results": results})


def _record(one: Detection) -> dict[str, Any]:
    length, width, height = one.box.size
    name = one.category or _UNKNOWN
    return {
        "sample_token": one.scan,
        "translation": list(one.box.centre),
        "size": [width, length, height],
        "rotation": list(one.box.quaternion_wxyz),
        "velocity": list(one.velocity or (0.0, 0.0)),
        "detection_name": name,
        "detection_score": one.score,
        "attribute_name": "",
        "tracking_id": one.track,
        "tracking_name": name,
        "tracking_score": one.score,
    }
