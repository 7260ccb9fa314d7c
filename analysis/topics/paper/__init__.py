"""Printed rewards and claims of the paper beside these runs."""
