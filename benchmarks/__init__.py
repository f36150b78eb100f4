"""Programs that print speed and error together with those of a peer from the same run; all in float64."""

import linkjax

linkjax.enable_x64()
