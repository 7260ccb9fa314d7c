"""Methods with which the learner is compared, one concept a file."""
