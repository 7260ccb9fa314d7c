"""Runs as they are stored."""
