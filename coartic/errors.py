"""Errors that a user can correct.

The message of such an error says what is wrong and what would be right; usually it also says where
the error is. A command that fails with such an error prints the message and exits with code 2.
"""


class CoarticError(Exception):
    """Base class of the errors that a user can correct."""


class TaskError(CoarticError):
    """A task or a family of tasks is missing or cannot be used."""


class SolutionError(CoarticError):
    """A solution cannot be used, usually because it breaks the rules of its task."""


class NotApplicableError(CoarticError):
    """A method or condition does not apply to a task or to a motion model.

    For example, an exploration condition uses a hand that the task does not have, a first solution
    uses a hand that the condition does not use, or a search for the initial hands finds no hand
    sequence that completes the task.
    """


class MissingExtraError(CoarticError, ImportError):
    """A package that :mod:`coartic.gym` needs is not installed; the message names the extra."""
