"""`python -m vestige`: the command line."""

from vestige.cli.main import main

main()
