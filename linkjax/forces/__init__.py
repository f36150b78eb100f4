"""Joint reactions, drive torque, shaking and frame forces."""

from linkjax.forces._approximation import Approximation as Approximation
from linkjax.forces._approximation import successive_approximation as successive_approximation
from linkjax.forces._basis import Basis as Basis
from linkjax.forces._basis import basis_of_pose as basis_of_pose
from linkjax.forces._basis import contacts_of as contacts_of
from linkjax.forces._friction import Contacts as Contacts
from linkjax.forces._friction import JointFriction as JointFriction
from linkjax.forces._friction import Linear as Linear
from linkjax.forces._friction import frictions_of as frictions_of
from linkjax.forces._friction import specks as specks
from linkjax.forces._kinetostatics import Forces as Forces
from linkjax.forces._kinetostatics import JointForce as JointForce
from linkjax.forces._kinetostatics import at_change_point as at_change_point
from linkjax.forces._kinetostatics import driven_by_joint as driven_by_joint
from linkjax.forces._kinetostatics import forces_of_pose as forces_of_pose
from linkjax.forces._kinetostatics import friction_of_pose as friction_of_pose
from linkjax.forces._kinetostatics import has_linear_reactions as has_linear_reactions
from linkjax.forces._kinetostatics import kinetostatics as kinetostatics
from linkjax.forces._kinetostatics import other_sides as other_sides
from linkjax.forces._locking import Locking as Locking
from linkjax.forces._locking import locking_of_pose as locking_of_pose
from linkjax.forces._meshes import Mesh as Mesh
from linkjax.forces._meshes import meshes as meshes
from linkjax.forces._meshes import through_meshes as through_meshes
