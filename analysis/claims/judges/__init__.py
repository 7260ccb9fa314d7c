"""Tests that claims share."""
