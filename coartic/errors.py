"""Errors meant for the person at the keyboard.

Every message says what was wrong, where, and what would be right. The command
line prints it as it stands and exits with code 2.
"""


class CoarticError(Exception):
    """An error that the user can put right."""


class TaskError(CoarticError):
    """A task file or task definition that cannot be used."""


class SolutionError(CoarticError):
    """A solution that breaks the rules of its task."""


class NotApplicableError(CoarticError):
    """A method, a condition or a search for hands does not apply to a task."""
