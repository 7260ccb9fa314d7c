"""How figures are drawn: looks, the robot, files. Topics draw their own."""
