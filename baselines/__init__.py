"""Methods the learner is compared with, one concept a file."""
