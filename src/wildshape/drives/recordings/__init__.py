# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a drive is read from, a module a kind of recording. Start with `recording_kinds`."""
