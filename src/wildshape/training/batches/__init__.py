# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""From a packed store to the batches of a step, drawn on the host or on the device.

Start with `views`.
"""
