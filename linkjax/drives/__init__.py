"""What drives the crank: motors, the transmission between motor and crank, the rotor, and flywheels."""

from linkjax.drives._drive import Breakaway as Breakaway
from linkjax.drives._drive import MotorDrive as MotorDrive
from linkjax.drives._drive import inertia_of_gd2 as inertia_of_gd2
from linkjax.drives._flywheels import Disc as Disc
from linkjax.drives._flywheels import Rim as Rim
from linkjax.drives._flywheels import disc_flywheel as disc_flywheel
from linkjax.drives._flywheels import rim_flywheel as rim_flywheel
from linkjax.drives._induction import InductionCircuit as InductionCircuit
from linkjax.drives._induction import InductionMotor as InductionMotor
from linkjax.drives._induction import phase_voltage_of as phase_voltage_of
from linkjax.drives._induction import warm_resistance as warm_resistance
from linkjax.drives._keys import KEYS as KEYS
from linkjax.drives._keys import UNITS as UNITS
from linkjax.drives._keys import DriveNumber as DriveNumber
from linkjax.drives._keys import drive_numbers as drive_numbers
from linkjax.drives._motors import AbstractMotor as AbstractMotor
from linkjax.drives._motors import ConstantTorque as ConstantTorque
from linkjax.drives._motors import DCMotor as DCMotor
from linkjax.drives._motors import LineMotor as LineMotor
from linkjax.drives._motors import NoMotor as NoMotor
from linkjax.drives._motors import TableMotor as TableMotor
from linkjax.drives._servo import Servo as Servo
from linkjax.drives._servo import ServoMargins as ServoMargins
from linkjax.drives._servo import servo_margins as servo_margins
from linkjax.drives._transmission import Transmission as Transmission
