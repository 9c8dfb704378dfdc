# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What `convert` does: its sources by name, the work shared out, the output put together.

Start with `work`.
"""
