"""Command line: `main` is the table of commands, which are modules of this and other packages."""
