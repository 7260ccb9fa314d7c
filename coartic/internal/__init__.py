"""Parts that the packages share and users do not see: limits, sentences, files, processes. They
know no task, no robot and no method."""
