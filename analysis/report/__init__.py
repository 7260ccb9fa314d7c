"""The report of a results folder: a document, and what it is rendered to."""
