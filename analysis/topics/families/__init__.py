"""Results on families of random tasks."""
