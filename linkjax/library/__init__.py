"""Common machines by name, such as a four-bar, a slider-crank and a scissor lift."""

from linkjax.library._bars import four_bar as four_bar
from linkjax.library._bars import six_bar as six_bar
from linkjax.library._lift import scissor_lift as scissor_lift
from linkjax.library._slides import quick_return as quick_return
from linkjax.library._slides import scotch_yoke as scotch_yoke
from linkjax.library._slides import slider_crank as slider_crank
from linkjax.library._slides import toggle_press as toggle_press
