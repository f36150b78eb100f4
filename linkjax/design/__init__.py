"""Optimisation of a machine: design variables by name, an objective, constraints, exact peaks."""

from linkjax._renamed import old_names as old_names
from linkjax.design._cone import descend as descend
from linkjax.design._document import document as document
from linkjax.design._multistart import multistart as multistart
from linkjax.design._names import DesignError as DesignError
from linkjax.design._names import changed as changed
from linkjax.design._names import number as number
from linkjax.design._names import numbers as numbers
from linkjax.design._optimise import ConstraintResult as ConstraintResult
from linkjax.design._optimise import Optimum as Optimum
from linkjax.design._optimise import optimise as optimise
from linkjax.design._optimise import optimize as optimize
from linkjax.design._optimise import settled as settled
from linkjax.design._optimise import solve as solve
from linkjax.design._problem import Problem as Problem
from linkjax.design._scipy import slsqp as slsqp
from linkjax.design._scipy import trust as trust
from linkjax.design._squares import sum_of_squares as sum_of_squares
from linkjax.design._starts import Progress as Progress
from linkjax.design._synthesis import function_error as function_error
from linkjax.design._synthesis import path_error as path_error
from linkjax.design._synthesis import position_error as position_error
from linkjax.design._terms import Limit as Limit
from linkjax.design._terms import Term as Term
from linkjax.design._terms import as_rows as as_rows
from linkjax.design._terms import as_term as as_term
from linkjax.design._terms import at_least as at_least
from linkjax.design._terms import at_most as at_most
from linkjax.design._text import outcome as outcome
from linkjax.design._texts import limit as limit
from linkjax.design._variables import Case as Case
from linkjax.design._variables import Variable as Variable

__getattr__ = old_names(__name__)
