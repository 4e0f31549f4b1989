# SPDX-License-Identifier: GPL-3.0-or-later
"""Verbs: a file a verb, named as the verb. Command line, Python API and help come from it."""

from ._base import COMMANDS, Command, Outcome, as_function, flag_of

__all__ = ["COMMANDS", "Command", "Outcome", "as_function", "flag_of"]
