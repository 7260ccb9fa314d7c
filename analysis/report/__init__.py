"""The report of a results folder: its page, tables and summary."""
