"""Make the report of a results folder: its page, tables and figures."""
