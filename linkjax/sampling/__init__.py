"""A machine evaluated at many places of its cycle at once."""

from linkjax.sampling._sample import Sample as Sample
from linkjax.sampling._sample import sample_at as sample_at
from linkjax.sampling._sampler import Ahead as Ahead
from linkjax.sampling._sampler import Sampler as Sampler
