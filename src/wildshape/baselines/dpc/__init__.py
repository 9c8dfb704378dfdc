# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""DPC, DPC-dagger and DPC-LIDAR (Insafutdinov and Dosovitskiy 2018): network, losses, training.

Start with `completer`, the row of a table; `run` trains it.
"""
