"""What stored runs say: comparisons and figures. Imports ``coartic`` and reads records."""
