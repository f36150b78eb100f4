"""The command line, the only part that prints.

Exit codes: 0 success; 1 the machine cannot be assembled, has no steady-state motion (all other results are printed and
written), or cannot satisfy all constraints; 2 wrong input; 130 optimisation interrupted (the best design is written).
"""

from linkjax.cli._main import main as main
