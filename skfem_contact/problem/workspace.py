"""`Workspace`: what one solve remembers from iteration to iteration, and hands on to the next one.

A contact problem keeps the factors of its last iteration, what it has left out, and more, as most
iterations of a load history ask for the set of the last one. That changes while a loop runs, so it must
not be shared: threads that solve at once on one solver would take each other's. Each solve borrows
problems with a memory of their own and gives them back when it ends. Solves that follow each other
borrow the same ones; only where several run at once there are several.

All that such problems of one pairing share, the stiffness S above all, does not change.
"""

from __future__ import annotations

from skfem_contact.errors import ContactError
from skfem_contact.problem.model import LinearModel
from skfem_contact.problem.seam import ContactProblem


class Workspace:
    """The contact problems that a solve has borrowed; for one thread.

    Used as a context it gives them back at the end, and after errors that say something of the load.
    After any other, such as an interrupt, nobody knows what was being written: they are left.
    """

    def __init__(self) -> None:
        self._borrowed: dict[ContactProblem, ContactProblem] = {}

    def problem(self, model: LinearModel) -> ContactProblem:
        """The contact problem on the pairing of the undeformed bodies, for this solve alone."""
        shared = model.problem_on(None, None)
        own = self._borrowed.get(shared)
        if own is None:
            try:
                own = shared.idle.pop()
            except IndexError:
                own = shared.anew()
            self._borrowed[shared] = own
        return own

    def __enter__(self) -> Workspace:
        return self

    def __exit__(self, kind: type[BaseException] | None, *rest: object) -> None:
        if kind is None or issubclass(kind, ContactError):
            for shared, own in self._borrowed.items():
                shared.idle.append(own)
        self._borrowed = {}
