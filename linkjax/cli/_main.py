"""The entry point: what every command ends in.

Exit codes: 0 done, 1 the machine cannot do it (cannot be assembled, no steady motion at this speed, then all else is
printed and written; limits that clash), 2 bad input, 130 an optimisation that was interrupted (its best design is
written).
"""

from __future__ import annotations

import sys

from linkjax._compile import stop
from linkjax._results import MachineError
from linkjax._units import QuantityError
from linkjax.cli import _exchange as _exchange  # their commands join the others
from linkjax.cli import _optimise as _optimise
from linkjax.cli._app import app
from linkjax.cli._console import complaints
from linkjax.design import DesignError
from linkjax.scenes import SceneError


def main() -> None:
    """Entry point of `linkjax`."""
    try:
        app(standalone_mode=True)
    except (DesignError, QuantityError, SceneError) as error:
        complaints.print(str(error), markup=False, highlight=False, soft_wrap=True)
        sys.exit(2)
    except OSError as error:
        complaints.print(f"{error.filename or ''}: {error.strerror or error}; choose another place", markup=False,
                         highlight=False, soft_wrap=True)  # fmt: skip
        sys.exit(2)
    except MachineError as error:
        complaints.print(str(error), markup=False, highlight=False, soft_wrap=True)
        sys.exit(1)
    finally:
        stop()  # interrupted: what waits to be compiled is not waited for
