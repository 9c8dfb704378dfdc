# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Work spread over processes of this machine, or over a Ray cluster; lost work is redone.

It knows nothing of scans: it maps a function over parts. Start with `processes`.
"""
