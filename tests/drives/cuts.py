# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Files of clusters, as the first stage of a drive leaves them for the others."""

import numpy as np

from wildshape.drives.tracking.segmentation import cut_file


def write_cut(folder, frame, clusters, scanned, grounds=None):
    """The clusters of a frame, which are the first points of a scan of so many."""
    points = np.concatenate((np.empty((0, 3)), *clusters)).astype(np.float32)
    known = {"points": points, "rows": np.arange(len(points), dtype=np.int32), "scanned": scanned}
    known["grounds"] = np.zeros((len(clusters), 3)) if grounds is None else np.array(grounds)
    known["seconds"] = np.empty(0)
    counts = np.array([len(cluster) for cluster in clusters], int)
    folder.mkdir(parents=True, exist_ok=True)
    np.savez(cut_file(folder, frame), **known, counts=counts, tracks=np.array([], str))
