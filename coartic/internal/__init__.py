"""Parts that the packages share and users do not see: limits, sentences, files, processes. These
parts import no task, robot or method."""
