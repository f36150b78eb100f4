"""Transient motion: run-up, load on and off, run-down, standstill."""

from linkjax.runs._document import run_document as run_document
from linkjax.runs._run import run as run
from linkjax.runs._run_up import no_start as no_start
from linkjax.runs._run_up import run_up_time as run_up_time
from linkjax.runs._starting import Starting as Starting
from linkjax.runs._starting import starting_torque as starting_torque
from linkjax.runs._transient import Energies as Energies
from linkjax.runs._transient import Transient as Transient
