"""The gear or belt between motor and crank: ratio, losses by the direction of power, creep."""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._types import as_float, known
from linkjax.drives._motors import check_numbers


class Transmission(eqx.Module):
    """A gear or belt between the shaft of a motor and the crank: motor speed over crank speed `ratio`, `efficiency`
    where power flows from the motor to the crank (None: no losses), `efficiency_back` where it flows back (None: the
    same), and the `creep` of a belt (None: no creep).

    Without creep the motor turns at ratio · ω, and the torque τ at its shaft gives the crank ratio · efficiency · τ, or
    ratio · τ / efficiency_back where power flows back: the power loss is never negative. The losses are those of
    friction that is in proportion to the load, as in a `LossyGear` of the Modelica Standard Library without bearing
    friction. With creep the crank turns slower, ω = ω_motor / ratio · (1 - creep), and the torque ratio stays `ratio`,
    so that the efficiency of power is efficiency · (1 - creep). The same relation of speeds holds where power flows
    back; the torque is then ratio · τ / (efficiency_back (1 - creep)), so that efficiency_back is that of power.

    Raises `ValueError` unless the ratio is above zero, the efficiencies are above zero and at most one, and the creep
    is zero or more and below one. A self-locking gear, which passes no power back, cannot be described.
    Source: C. Pelchen, C. Schweiger, M. Otter, Modeling and simulating the efficiency of gearboxes and of planetary
    gearboxes, 2nd International Modelica Conference (2002) 257-266.
    """

    ratio: Array = eqx.field(converter=as_float, default=1.0)
    efficiency: Array | None = eqx.field(converter=as_float, default=None)
    efficiency_back: Array | None = eqx.field(converter=as_float, default=None)
    creep: Array | None = eqx.field(converter=as_float, default=None)

    def __check_init__(self):
        names = ("ratio", "efficiency", "efficiency_back")
        check_numbers("a transmission", {name: getattr(self, name) for name in names}, {"creep": self.creep})
        for name in ("efficiency", "efficiency_back"):
            value = known(getattr(self, name))
            if value is not None and np.any(value > 1):
                raise ValueError(f"{name} of a transmission is {value}, above one; write e.g. 0.95")
        creep = known(self.creep)
        if creep is not None and np.any(creep >= 1):
            raise ValueError(f"creep of a transmission is {creep}; write a part of the speed, e.g. 0.02")

    @property
    def loses(self) -> bool:
        """Whether the torque on the crank depends on the direction of power: whether efficiency or creep is given."""
        return any(part is not None for part in (self.efficiency, self.efficiency_back, self.creep))

    def speed_ratio(self) -> Array:
        """Motor speed over crank speed: ratio / (1 - creep)."""
        return self.ratio if self.creep is None else self.ratio / (1 - self.creep)

    def torque_ratio(self, forward: Array) -> Array:
        """Crank torque over the torque at the motor's shaft; `forward` is true where power flows to the crank."""
        if not self.loses:
            return self.ratio * jnp.ones(jnp.shape(forward), self.ratio.dtype)
        ahead = jnp.ones_like(self.ratio) if self.efficiency is None else self.efficiency
        back = ahead if self.efficiency_back is None else self.efficiency_back
        kept = 1.0 if self.creep is None else 1 - self.creep
        return self.ratio * jnp.where(forward, ahead, 1 / (back * kept))
