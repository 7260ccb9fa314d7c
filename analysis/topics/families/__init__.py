"""What holds on families of random tasks."""
