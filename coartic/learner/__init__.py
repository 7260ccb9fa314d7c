"""The dual-process learner. It knows motion and the base of methods, and no other method."""
