"""What the paper does not print of the two-armed tasks: searched, scored, kept as an ensemble.

``layouts`` says where goals may be and what they must give, ``search`` finds such goals,
``scoring`` compares what is learned there with what is printed, and ``ensemble`` chooses.
``readings`` judges readings of the text, ``robustness`` the claims under every choice.
"""
