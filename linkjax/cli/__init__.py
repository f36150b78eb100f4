"""The command line: the only place that prints.

Exit codes: 0 done, 1 the machine cannot do it (cannot be assembled, no steady motion at this speed, then all else is
printed and written; limits that clash), 2 bad input, 130 an optimisation that was interrupted (its best design is
written).
"""

from linkjax.cli._main import main as main
