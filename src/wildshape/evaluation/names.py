# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The figures of `metrics.json` by name, and their units."""

# Names fixed in the design, then what stands beside them.
NAMES = (
    "cd",
    "precision",
    "coverage",
    "acc30",
    "rot_median_deg",
    "trans_median_m",
    "acc30_sym",
    "rot_sym_median_deg",
    "cd_partial",
    "precision_partial",
    "coverage_partial",
    "cd_floor",
    "points",
    "truth_points",
    "partial_points",
    "confidence_rank_correlation",
    "risk_coverage_area",
    "box_iou",
    "heading30",
    "heading30_sym",
    "heading_sym_median_deg",
)
UNITS = {
    "cd, precision, coverage, *_partial, cd_floor, trans_median_m": "metres",
    "acc30, acc30_sym": "share, 0 to 1",
    "rot_median_deg, rot_sym_median_deg": "degrees",
    "confidence_rank_correlation": "Spearman, doubt with cd: 1 orders perfectly, 0 by chance",
    "risk_coverage_area, risk_coverage": "metres of cd, over the share of the surest scans",
    "box_iou": "shared over joint volume of oriented boxes, 0 to 1, mean",
    "heading30, heading30_sym": "share, 0 to 1; heading_sym_median_deg: degrees",
    "std": "sample standard deviation over seeds; null for one seed",
}
