"""`python -m linkjax`: the command line."""

from linkjax.cli import main

main()
