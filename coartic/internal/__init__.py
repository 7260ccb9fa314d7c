"""Parts that the packages share and that are no public interface: limits, files, texts, workers."""
