"""Tasks, the names under which they are found, and families of random tasks. They import the robot
and its motion, and no method."""
