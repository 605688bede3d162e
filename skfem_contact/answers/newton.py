"""Newton's method on bodies that are not linear: the log of a load step."""

from __future__ import annotations

from skfem_contact.records import dataclass


@dataclass(frozen=True)
class Iteration:
    """One linearisation of the bodies, and the step that it led to.

    Attributes
    ----------
    number : int
        Within its part of the load step.
    aim : float
        Share of the load step at the end of that part; 1 where it was not cut.
    residual : float
        Largest force that is missing to equilibrium after it, over the largest force that acts.
    step : float
        Share of the step that was taken: 1 where the residual fell at once.
    contact : int
        Iterations of contact.
    """

    number: int
    aim: float
    residual: float
    step: float
    contact: int

    def __str__(self) -> str:
        words = f"{self.number:3d}  residual {self.residual:8.1e}  contact {self.contact:3d}"
        words += "" if self.step == 1.0 else f"  {self.step:.3g} of a step"
        return words + ("" if self.aim == 1.0 else f"  to {self.aim:.4g} of the load step")


class Newton(tuple[Iteration, ...]):
    """The linearisations of a load step, in their order; printed, a line for each.

    Examples
    --------
    >>> print(Newton([Iteration(1, 1.0, 2e-3, 1.0, 4), Iteration(2, 1.0, 5e-12, 1.0, 1)]))
      1  residual  2.0e-03  contact   4
      2  residual  5.0e-12  contact   1
    """

    __slots__ = ()

    def __str__(self) -> str:
        return "\n".join(map(str, self))
