"""Command line: one thin module per command. Slow imports are inside the command functions, so --help stays fast."""
