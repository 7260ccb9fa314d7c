"""The report of a results folder: page, tables and summary."""
