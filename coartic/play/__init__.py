"""The page on which a reader moves goals and watches the robot answer (`coartic play`): the model
once more, in JavaScript. It knows tasks alone."""
