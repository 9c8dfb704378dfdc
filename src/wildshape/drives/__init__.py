# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Raw drives: a recording of full scans in, every vehicle's track, boxes and shape out, unlabelled.

One module a stage, each with one public function. Start with `run`; the stages are in its order.
"""
