"""Findings about people, put to the models."""
