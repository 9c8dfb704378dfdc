# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Raw drives: a recording of full scans in, every vehicle's track, boxes and shape out, unlabelled.

Start with `pipeline`, which calls the stages in their order; `run` is what a user calls.
`recordings` are read scan by scan, `tracking` finds clusters and follows them, `completing` makes
vehicles of tracks, `adapting` trains on them, `writing` puts them on disk.
"""
