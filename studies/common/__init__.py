"""Code that studies share: verdicts on claims, and the files of a study."""
