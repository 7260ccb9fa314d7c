"""Code that studies share: it judges claims, and writes the files of a study."""
