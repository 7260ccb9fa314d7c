"""Folders whose question is which setting of a method is best: those of a suite with a grid.

In such a folder every setting is shown beside the others, as methods are in other folders, and the
default says its value. Elsewhere methods are compared as they are by default.
"""

from __future__ import annotations

from coartic.analysis.methods import INITIAL, RANDOM_SEARCHES, is_search, name_of
from coartic.analysis.study import Study, cached


@cached
def varied(study: Study) -> dict[str, list[str]]:
    """Parameters of each method that have several values on one task, by method."""
    values: dict[tuple[str, str, str], set[str]] = {}
    several: dict[str, list[str]] = {name: [] for name in study.declared}
    for cell in (job.cell for job in study.plan):
        for key, value in cell.parameters.items():
            values.setdefault((cell.method.name, cell.task.name, key), set()).add(repr(value))
    for (method, _, key), seen in values.items():
        if len(seen) > 1 and key not in several[method]:
            several[method].append(key)
    return several


@cached
def compares_settings(study: Study) -> bool:
    """Whether all methods but references have several settings."""
    several = [
        names
        for method, names in varied(study).items()
        if method not in (INITIAL, *RANDOM_SEARCHES) and not is_search(method)
    ]
    return bool(several) and all(several)


@cached
def names_of_settings(study: Study) -> dict[str, str]:
    """Names of default settings by label, where settings are compared: ``learner EC1 (σ 0.05,
    default)``."""
    names = {}
    for cell in (job.cell for job in study.plan) if compares_settings(study) else ():
        keys = varied(study)[cell.method.name]
        if keys and not cell.setting:
            values = ", ".join(f"{key}={cell.parameters[key]}" for key in keys)
            names[cell.label] = f"{name_of(f'{cell.label} {values}')[:-1]}, default)"
    return names


def name_in(study: Study, label: str) -> str:
    """The name of a method in a folder; a default that stands beside others has its value."""
    return names_of_settings(study).get(label) or name_of(label)
