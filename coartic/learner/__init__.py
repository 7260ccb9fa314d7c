"""The dual-process learner. It imports tasks, motion and the base of methods, no other method."""
