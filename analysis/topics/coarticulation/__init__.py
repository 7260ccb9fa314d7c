"""Coarticulation: contexts and signatures."""
