"""What holds beyond the paper's tasks: instances of families of random tasks in a folder."""
