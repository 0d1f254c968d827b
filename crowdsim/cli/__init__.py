"""The command line, one file per group of commands. Heavy modules are imported only when a command runs."""
