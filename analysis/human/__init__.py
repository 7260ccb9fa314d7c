"""Models beside people: what published findings predict for the robot, and which models show it.

``human.toml`` has the findings, ``measures.py`` what they are put to, ``judge.py`` the verdicts.
"""
