"""The analysis of a working cycle, its JSON document and its columns."""

from linkjax._renamed import old_names as old_names
from linkjax.analysis._analyse import analyse as analyse
from linkjax.analysis._analyse import analyze as analyze
from linkjax.analysis._analyse import compile_ahead as compile_ahead
from linkjax.analysis._checks import LIGHTEST as LIGHTEST
from linkjax.analysis._cycle import Checks as Checks
from linkjax.analysis._cycle import Cycle as Cycle
from linkjax.analysis._cycle import Maybe as Maybe
from linkjax.analysis._cycle import explain as explain
from linkjax.analysis._document import check_limit as check_limit
from linkjax.analysis._document import document as document
from linkjax.analysis._document import moves as moves
from linkjax.analysis._document import plain as plain
from linkjax.analysis._energy_mass import EnergyMass as EnergyMass
from linkjax.analysis._energy_mass import energy_mass as energy_mass
from linkjax.analysis._given import at_acceleration as at_acceleration
from linkjax.analysis._harmonic_table import harmonics_document as harmonics_document
from linkjax.analysis._harmonics import asked_harmonics as asked_harmonics
from linkjax.analysis._harmonics import harmonics as harmonics
from linkjax.analysis._loads import LoadRun as LoadRun
from linkjax.analysis._measured import asked_measures as asked_measures
from linkjax.analysis._measured import measured as measured
from linkjax.analysis._missing import massless as massless
from linkjax.analysis._motor import MotorRun as MotorRun
from linkjax.analysis._overload import Overload as Overload
from linkjax.analysis._overload import overload_rows as overload_rows
from linkjax.analysis._pick import pick as pick
from linkjax.analysis._precision import float32_digits as float32_digits
from linkjax.analysis._table import columns as columns
from linkjax.analysis._text import energy_rows as energy_rows
from linkjax.analysis._text import motor_rows as motor_rows
from linkjax.analysis._tidy import CONSTANT as CONSTANT
from linkjax.analysis._tidy import acts_text as acts_text
from linkjax.analysis._tidy import force_scale as force_scale
from linkjax.analysis._tidy import measure_scales as measure_scales
from linkjax.analysis._tidy import peak_motions as peak_motions
from linkjax.analysis._tidy import peak_place as peak_place
from linkjax.analysis._tidy import peak_shown as peak_shown
from linkjax.analysis._tidy import power_scale as power_scale
from linkjax.analysis._tidy import tied as tied
from linkjax.analysis._tidy import torque_scale as torque_scale
from linkjax.analysis._tidy import uneven as uneven
from linkjax.analysis._words import peak_label as peak_label
from linkjax.analysis._words import peak_unit as peak_unit

__getattr__ = old_names(__name__)
