"""The command line: one file a sub-command, and what both command lines share."""
