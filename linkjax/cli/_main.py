"""The entry point of the command line.

Exit codes: 0 success; 1 the machine cannot be assembled, has no steady-state motion, does not start or stalls in a run
(all other results are printed and written), or cannot satisfy all constraints; 2 wrong input; 130 optimisation
interrupted (the best design is written).
"""

from __future__ import annotations

import sys
import warnings

from linkjax._compile import stop
from linkjax._results import MachineError
from linkjax._units import QuantityError
from linkjax.cli import _element as _element  # adds their commands to `app`
from linkjax.cli import _exchange as _exchange
from linkjax.cli import _optimise as _optimise
from linkjax.cli import _run as _run
from linkjax.cli._app import app
from linkjax.cli._console import complaints
from linkjax.cli._help import more
from linkjax.design import DesignError
from linkjax.mechanism import StructureError
from linkjax.scenes import SceneError


def main() -> None:
    """Entry point of `linkjax`."""
    warnings.showwarning = warned
    try:
        app(standalone_mode=True)
    except (DesignError, QuantityError, SceneError, StructureError) as error:
        complain(str(error))
        sys.exit(2)
    except OSError as error:
        complain(f"{error.filename or ''}: {error.strerror or error}; choose another place")
        sys.exit(2)
    except MachineError as error:
        complain(str(error))
        sys.exit(1)
    finally:
        stop()  # after an interrupt, do not wait for pending compilations


def warned(message: Warning | str, *_: object) -> None:
    """Print a warning in one line, without the place in the code."""
    complain(f"WARNING: {message}")


def complain(message: str) -> None:
    """Print a message, on its line with the section of the documentation that says more."""
    where = more(message)
    complaints.print(f"{message} ({where})" if where else message, markup=False, highlight=False, soft_wrap=True)
