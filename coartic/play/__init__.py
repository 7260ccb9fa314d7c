"""The page on which a reader moves goals and watches the robot react (``coartic play``).

The page has its own implementation of the motion model, of the learner and of a planner, in
JavaScript. This package imports tasks, but no methods.
"""
