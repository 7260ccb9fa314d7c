"""A results folder: read, checked against its records, with the optima known of its tasks."""
