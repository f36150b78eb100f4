"""The command line by `python -m linkjax`."""

from linkjax.cli import main

main()
