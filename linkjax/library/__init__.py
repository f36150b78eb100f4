"""Machines by name: what a textbook calls a four-bar, a slider-crank, a scissor lift, as mechanisms."""

from linkjax.library._bars import four_bar as four_bar
from linkjax.library._bars import six_bar as six_bar
from linkjax.library._lift import scissor_lift as scissor_lift
from linkjax.library._slides import quick_return as quick_return
from linkjax.library._slides import scotch_yoke as scotch_yoke
from linkjax.library._slides import slider_crank as slider_crank
from linkjax.library._slides import toggle_press as toggle_press
