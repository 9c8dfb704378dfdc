# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""SemanticKITTI: points labelled by instance.

Start with `reader`.
"""
