"""What test modules share: suites run into folders, commands, reports read back, made-up rows."""
