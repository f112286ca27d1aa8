"""The command line: one file for each sub-command, and the parts shared with `mrjax-calibrate`."""
