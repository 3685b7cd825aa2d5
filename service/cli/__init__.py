"""The command line: `main` is the table of commands; each command lies beside what it drives."""
