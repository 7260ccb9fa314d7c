"""Errors meant for the person at the keyboard.

Messages say what is wrong and, mostly, where and what would be right. A command that
fails by such an error prints its message and exits with code 2.
"""


class CoarticError(Exception):
    """An error that the user can put right."""


class TaskError(CoarticError):
    """A task or a family of tasks that is missing or cannot be used."""


class SolutionError(CoarticError):
    """A solution that cannot be used, mostly because it breaks the rules of its task."""


class NotApplicableError(CoarticError):
    """A method, a condition or a search for hands cannot be used for a task or first solution."""


class MissingExtraError(CoarticError, ImportError):
    """A package is not installed that an extra, such as ``coartic[gym]``, installs."""
