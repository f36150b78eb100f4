"""Machines in the formats of other programs: MuJoCo's models and pylinkage's JSON."""

from linkjax.exchange._mjcf import to_mjcf as to_mjcf
