"""Shared by all tests."""

import os

from hypothesis import settings

# Continuous integration tries the same examples every time; people, new ones.
settings.register_profile("ci", derandomize=True, deadline=None)
settings.register_profile("people", deadline=None)
settings.load_profile("ci" if os.environ.get("CI") else "people")
