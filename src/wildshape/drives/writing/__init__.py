# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What is on disk once a drive is done, and how it is read back. Start with `outputs`."""
