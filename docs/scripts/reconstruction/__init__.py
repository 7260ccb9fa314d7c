"""The search for what the paper does not print, which ``reconstruct.py`` beside it runs.

``layouts`` says where goals may be and what they must give, ``search`` finds such goals,
``scoring`` compares learned results with the printed ones, and ``ensemble`` chooses. ``readings``
judges readings of the text.
"""
