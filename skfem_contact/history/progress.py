"""What a history shows while it runs: a bar with the load, the iterations and the time that is left."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.result import ContactResult
from skfem_contact.answers.values import status_words
from skfem_contact.errors import InputError


class Progress:
    """A bar of tqdm; the time that is left is that of the steps behind, in the mean.

    Parameters
    ----------
    steps : iterable
        With a length there is an estimate.
    prepare : callable
        What is done once, before the first step: it is no step, and not counted in the estimate.
    """

    def __init__(self, steps: Any, prepare: Callable[[], object]) -> None:
        try:
            from tqdm.auto import tqdm
        except ImportError:
            raise InputError(
                "progress=True needs tqdm, which is not installed: "
                "pip install 'skfem-contact[progress]'"
            ) from None
        total = count(steps)
        # smoothing=0: the mean of all steps, since the last is no better guess for the rest
        self.bar = tqdm(total=total, unit="step", smoothing=0, desc="condensing the bodies")
        try:
            prepare()
        except BaseException:
            self.bar.close()
            raise
        self.bar.set_description("load steps", refresh=False)
        self.bar.reset(total=total)

    def shows(self, answer: Answer) -> None:
        """One step more."""
        self.bar.set_postfix_str(words(answer), refresh=False)
        self.bar.update()

    def close(self) -> None:
        """The bar stays as it is."""
        self.bar.close()


class Silent:
    """In place of a bar."""

    def shows(self, answer: Answer) -> None:
        """Nothing."""

    def close(self) -> None:
        """Nothing."""


def count(steps: Any) -> int | None:
    """How many steps there are, where that is known."""
    try:
        return len(steps)
    except TypeError:  # a generator; or what is no list of steps, which is refused where it is read
        return None


def words(answer: Answer) -> str:
    """The load and how it was found."""
    load = "" if answer.factor is None else f"load factor {answer.factor:g}, "
    return f"{load}{answer.iterations} iteration{'s' if answer.iterations != 1 else ''}"


def line(number: int, total: int | None, answer: Answer) -> str:
    """A line of the log: which step, how it ended, and what every contact does."""
    of = "" if total is None else f" of {total}"
    load = "" if answer.factor is None else f", load factor {answer.factor:g}"
    contacts = (f"{values.name}: {status_words(values)}" for values in ContactResult(answer))
    return "; ".join([f"step {number}{of}{load}: {answer.message}", *contacts])


def reached(number: int, total: int | None) -> str:
    """For an exception that ends a history: how far it came, and where that is."""
    of = "" if total is None else f" of {total}"
    steps = "step was" if number == 1 else "steps were"
    return (
        f"{number}{of} load {steps} finished before: their results are in `.results` of this exception "
        "(sys.last_value.results in an interactive session)"
    )
