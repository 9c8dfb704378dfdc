# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The evaluation protocol of METHOD 8: metrics, tables, figures.

A figure is computed in `metrics` and named in `summary`. Methods are handed in: models
and baselines live elsewhere; `drives` measures whole recordings. Start with `protocol`.
"""
