"""The dual-process learner."""
