"""Programs that print speed against error, side by side with a peer in the same run; all of them in float64."""

import linkjax

linkjax.enable_x64()
