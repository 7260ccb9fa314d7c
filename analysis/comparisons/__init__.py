"""Methods against each other: pair by pair on each task, and over all tasks."""
