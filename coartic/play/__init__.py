"""The page on which a reader moves goals and watches the robot react (`coartic play`).

It has the model a second time, in JavaScript. It knows tasks, but no methods.
"""
