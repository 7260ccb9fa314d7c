"""Errors that a user can correct.

The message of such an error says what is wrong, usually where, and what would be right. A command
that fails with such an error prints the message and exits with code 2.
"""


class CoarticError(Exception):
    """Base class of the errors that a user can correct."""


class TaskError(CoarticError):
    """A task or a family of tasks is missing or cannot be used."""


class SolutionError(CoarticError):
    """A solution cannot be used, usually because it breaks the rules of its task."""


class NotApplicableError(CoarticError):
    """A method or condition does not apply to a task.

    For example, an exploration condition uses a hand that does not occur in the task or in the
    first solution, or a search for the initial hands finds no sequence that completes the task.
    """


class MissingExtraError(CoarticError, ImportError):
    """A package of an extra, such as ``coartic[gym]``, is not installed."""
