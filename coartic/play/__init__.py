"""The page on which a reader moves goals and watches the robot answer (`coartic play`)."""
