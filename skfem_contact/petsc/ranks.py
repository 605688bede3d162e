"""Rank 0 runs the script, the other ranks serve it.

As PETSc's own server of linear solvers does it: all ranks start the same script, and those other than
0 leave it where the first `PETSc()` is made. From there on they wait for commands, hold their rows of
matrices, and end with rank 0. So contact is solved, printed and written once, and nothing can come out
differently on two ranks.

A rank that fails says why and ends all; the others might wait for it in the middle of a solve.
"""

from __future__ import annotations

import atexit
import os
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterable
from functools import cached_property, lru_cache
from typing import Any, NoReturn

import numpy as np
from scipy.sparse import csr_matrix

from skfem_contact.arrays import Array
from skfem_contact.errors import InputError, LinearSolveError, warn
from skfem_contact.petsc.body_share import BodyShare
from skfem_contact.petsc.share import Database, Settings, Share, Solved, command_line

# Between two looks for the next command a rank sleeps this part of the time that it has waited, and at
# most so many seconds: it takes no core from the one that works, and commands that follow soon are met.
LATER = 1e-2

# Seconds after which rank 0 says that it waits for ranks that have not come to `PETSc()`.
MISSED_AFTER = 60.0

INSTALL = (
    "PETSc() needs petsc4py and mpi4py, which Python does not find ({error}). On Debian and Ubuntu: "
    "apt-get install python3-petsc4py python3-mpi4py, with the system's own Python (or a venv of it "
    "made with --system-site-packages) and PETSC_DIR set to the folder of PETSc, "
    "/usr/lib/petscdir/petsc*/*-real; elsewhere: pip install 'skfem-contact[petsc]', which builds "
    "PETSc, or conda install petsc4py mpi4py. See docs/petsc.md."
)


@lru_cache(maxsize=1)
def ranks() -> Ranks:
    """The ranks of this process. Does not return on ranks other than 0.

    Raises
    ------
    InputError
        If petsc4py or mpi4py are missing, or PETSc calculates with complex numbers.
    """
    try:
        import petsc4py
        from mpi4py import MPI
        from mpi4py.util.pkl5 import Intracomm  # sends arrays of any size without copying them

        petsc4py.init(command_line())
        from petsc4py import PETSc
    except ImportError as error:
        raise InputError(INSTALL.format(error=error)) from None
    if np.dtype(PETSc.ScalarType) != np.float64:
        raise InputError(
            f"PETSc calculates with {np.dtype(PETSc.ScalarType)} here; PETSc() needs one with real "
            "numbers in double precision. On Debian set PETSC_DIR to a folder that ends in -real."
        )
    _wait_for_all(MPI.COMM_WORLD)
    comm = MPI.COMM_WORLD.Dup()
    own = Ranks(PETSc, MPI, comm, Intracomm(comm))
    if own.rank:
        own.serve()
    atexit.register(own.stop)
    # where the script ends MPI by itself: MPI then first deletes the attributes of COMM_SELF
    key = MPI.Comm.Create_keyval(delete_fn=lambda *_: own.stop(True))
    MPI.COMM_SELF.Set_attr(key, own)
    return own


def _wait_for_all(world: Any) -> None:
    """Until all ranks have made a `PETSc()`."""
    begin, here = time.monotonic(), world.Ibarrier()
    late = False
    while not here.Test():
        time.sleep(LATER)
        if world.rank == 0 and not late and time.monotonic() > begin + MISSED_AFTER:
            late = True
            warn(
                f"rank 0 of {world.size} has waited for {MISSED_AFTER:.0f} s for the others to come to "
                "PETSc(), which every rank has to make. Where that takes long, make it first of all."
            )


class Ranks:
    """All ranks, as rank 0 commands them, or as another one serves.

    Attributes
    ----------
    rank, size : int
        Number of this one, and how many there are.
    comm, messages : Intracomm
        All of them, for PETSc, and as objects with large arrays are sent.
    """

    def __init__(self, PETSc: Any, MPI: Any, comm: Any, messages: Any = None) -> None:
        self.PETSc, self.MPI, self.comm, self.messages = PETSc, MPI, comm, messages
        self.rank, self.size = int(comm.rank), int(comm.size)
        self.one = threading.RLock()  # of several threads of the script one at a time has all ranks
        self.shares: dict[int, Share] = {}
        self.held: dict[int, Any] = {}  # rows of stiffness, see `stiffness` and `stacked`
        self._count, self._dropped, self._stopped = 0, [], False  # type: int, list[int], bool

    @cached_property
    def database(self) -> Database:
        """PETSc's options on this rank."""
        return Database(self.PETSc)

    @property
    def largest_integer(self) -> int:
        """Return the largest number that PETSc's indices count to."""
        return int(np.iinfo(self.PETSc.IntType).max)

    # -- commands of rank 0 -------------------------------------------------------------------

    def number(self) -> int:
        """The next number of a matrix."""
        self._count += 1
        return self._count

    def together(
        self,
        work: Callable[[Ranks, tuple[Any, ...], list[Any]], list[Any]],
        given: tuple[Any, ...] = (),
        pieces: Iterable[list[Any]] | None = None,
    ) -> list[list[Any]]:
        """Let every rank do some work on its piece; returns what each of them gives back.

        Parameters
        ----------
        work : callable
            A function of this library, which the other ranks find by its name.
        given : tuple
            The same for all.
        pieces : iterable of list, optional
            For each rank; only one exists at a time.
        """
        mine, others = list[Any](), range(1, self.size)
        with self.one:
            dropped, self._dropped = self._dropped, []
            for rank in others:
                self.messages.send((work, given, dropped), dest=rank)
            self.forget(dropped)
            try:
                for rank, parts in enumerate(pieces or ([] for _ in range(self.size))):
                    if rank == 0:
                        mine = parts
                    else:
                        self.messages.send(parts, dest=rank)
                    del parts  # before there is the next
                return [work(self, given, mine), *(self.messages.recv(source=rank) for rank in others)]
            except BaseException as error:
                if self.size > 1:  # what fails here meanwhile would leave the others waiting
                    self.fail()
                if not isinstance(error, self.PETSc.Error):
                    raise
                raise LinearSolveError(
                    f"PETSc says what it can not do, first where and then why: {error}. Look at the "
                    "options that you gave, by options= or -sc_... on the command line."
                ) from error

    def factorize(
        self, rows: Iterable[csr_matrix], directions: Iterable[Array | None], settings: Settings
    ) -> int:
        """Give each rank its rows; returns the number of the matrix."""
        key = self.number()
        self.together(_made, (key, settings), map(_parts, rows, directions))
        return key

    def solve(self, key: int, pieces: Iterable[Array]) -> tuple[Array, Solved]:
        """All rows of the answer, those of rank 0 first, and how it went."""
        found = self.together(_solved, (key,), ([piece] for piece in pieces))
        return np.concatenate([x for x, _ in found]), found[0][1]

    def drop(self, key: int) -> None:
        """Forget a matrix, at the next command: the garbage is collected at any time."""
        self._dropped.append(key)

    def memory(self) -> list[int]:
        """Largest memory that each rank has had so far [bytes]."""
        return [peak for (peak,) in self.together(_measured)]

    def stop(self, ending: bool = False) -> None:
        """Let the other ranks end; all free their matrices together, as PETSc needs it.

        Where MPI is `ending`, the script has ended it, and nothing else is to do so.
        """
        if self._stopped:
            return
        self._stopped = True
        unread = self.database.unread() if self._count else []
        with self.one:
            for rank in range(1, self.size):
                self.messages.send((None, (), []), dest=rank)
            self._end(ending)
        if unread:
            warn(
                f"PETSc has not looked for {', '.join('-' + name for name in unread)}: a name is "
                "misspelt, or nothing was solved that the option belongs to"
            )

    # -- what a serving rank does -------------------------------------------------------------

    def serve(self) -> NoReturn:
        """Carry out commands until rank 0 ends, and end."""
        sys.stdout.flush()
        try:
            while True:
                self._wait()
                work, given, dropped = self.messages.recv(source=0)
                if work is None:
                    break
                self.forget(dropped)
                self.messages.send(work(self, given, self.messages.recv(source=0)), dest=0)
        except BaseException:
            self.fail()
        sys.stdout.flush()
        sys.stderr.flush()
        self._end()
        os._exit(0)  # the rest of the script, and what it does at its end, is for rank 0

    def _wait(self) -> None:
        begin = time.monotonic()
        while not self.messages.Iprobe(source=0):
            time.sleep(LATER * min(time.monotonic() - begin, 1.0))

    # -- what all do --------------------------------------------------------------------------

    def make(self, key: int, settings: Settings, parts: list[Array]) -> None:
        """This rank's share of a matrix, ready to solve with."""
        kind = Share if settings.keep is None else BodyShare
        share = kind(self.database, self.comm, parts, settings)
        parts.clear()  # PETSc has its own copies: the set-up of multigrid is where memory is short
        share.set_up()
        self.shares[key] = share

    def forget(self, keys: list[int]) -> None:
        """Free matrices, in the same order on all ranks, as PETSc needs it."""
        for key in keys:
            (self.shares if key in self.shares else self.held).pop(key).destroy()

    def _end(self, ending: bool = False) -> None:
        """Give everything back while all are there to do so together."""
        self.forget([*sorted(self.shares), *self.held])
        self.comm.Free()
        self.PETSc._finalize()
        if not ending and not self.MPI.Is_finalized():  # PETSc does it where it came before mpi4py
            self.MPI.Finalize()

    def fail(self) -> NoReturn:
        """Say what went wrong here, and end all ranks."""
        words = (
            f"rank {self.rank} of {self.size} failed, and all end with it:\n{traceback.format_exc()}"
        )
        print(words, file=sys.stderr, flush=True)
        self.comm.Abort(1)
        os._exit(1)


# -- work of every rank -----------------------------------------------------------------------


def _made(own: Ranks, given: tuple[Any, ...], parts: list[Any]) -> list[Any]:
    key, settings = given
    own.make(key, settings, parts)
    return []


def _solved(own: Ranks, given: tuple[Any, ...], parts: list[Any]) -> list[Any]:
    """Rows of an answer, and how it went."""
    return [*own.shares[given[0]].solve(parts[0])]


def _measured(own: Ranks, given: tuple[Any, ...], parts: list[Any]) -> list[Any]:
    import resource  # not on every system, as MPI

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return [int(peak if sys.platform == "darwin" else 1024 * peak)]


def _parts(rows: csr_matrix, directions: Array | None) -> list[Array]:
    """Return what a rank is sent: its rows, and rigid motions on them."""
    parts = [np.array(rows.shape), rows.indptr, rows.indices, rows.data]
    return parts if directions is None else [*parts, directions]


def csr_of(parts: list[Array], shape: tuple[int, int]) -> csr_matrix:
    """A matrix from its arrays ``indptr``, ``indices`` and ``data``, as they are sent."""
    indptr, indices, data = parts
    return csr_matrix((data, indices, indptr), shape=shape)
