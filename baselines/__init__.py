"""Methods with which the learner is compared, one concept in each file."""
