"""Drawings, plots and animation of an analysed machine; figures are matplotlib `Figure` objects, nothing is global."""

from linkjax.viz._animation import animate as animate
from linkjax.viz._dynamics import speed_figure as speed_figure
from linkjax.viz._dynamics import torque_figure as torque_figure
from linkjax.viz._forces import drive_figure as drive_figure
from linkjax.viz._forces import reaction_hodographs_figure as reaction_hodographs_figure
from linkjax.viz._forces import reactions_figure as reactions_figure
from linkjax.viz._forces import shaking_figure as shaking_figure
from linkjax.viz._kinematics import acceleration_hodographs_figure as acceleration_hodographs_figure
from linkjax.viz._kinematics import centres_figure as centres_figure
from linkjax.viz._kinematics import inertia_figure as inertia_figure
from linkjax.viz._kinematics import links_figure as links_figure
from linkjax.viz._kinematics import points_figure as points_figure
from linkjax.viz._kinematics import velocity_hodographs_figure as velocity_hodographs_figure
from linkjax.viz._machine import machine_figure as machine_figure
from linkjax.viz._optimum import history_figure as history_figure
from linkjax.viz._optimum import trade_off_figure as trade_off_figure
from linkjax.viz._view import machine_view as machine_view
from linkjax.viz._write import PICTURES as PICTURES
from linkjax.viz._write import Picture as Picture
from linkjax.viz._write import courses as courses
from linkjax.viz._write import drawn as drawn
from linkjax.viz._write import svg as svg
from linkjax.viz._write import write_figures as write_figures
