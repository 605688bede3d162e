"""The contacts of a result: found by name, number or the contact itself, counted, gone through."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.single import OfTheContact
from skfem_contact.answers.split import values_of
from skfem_contact.answers.values import ContactValues
from skfem_contact.arguments import suggest
from skfem_contact.conditions.contact import Contact, number_of
from skfem_contact.errors import InputError


class ByContact(OfTheContact):
    """A result as its contacts; what is one contact's is also the result's where there is only one."""

    _answer: Answer

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the contacts, in the order given to the solver."""
        return self._answer.names

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """The contacts themselves."""
        return self._answer.contacts

    @cached_property
    def values(self) -> tuple[ContactValues, ...]:
        """The answer of every contact, in the order given."""
        return values_of(self._answer)

    def __getitem__(self, key: Contact | str | int) -> ContactValues:
        return self.values[self._position(key)]

    def __iter__(self) -> Iterator[ContactValues]:
        return iter(self.values)

    def __len__(self) -> int:
        return len(self.names)

    def __bool__(self) -> bool:
        return True  # of a result with `if result:` nobody asks how many contacts it has

    def __contains__(self, key: object) -> bool:
        known = isinstance(key, str) and key in self.names
        return known or number_of(key, self.contacts) is not None or any(key is own for own in self)

    def _position(self, key: Contact | str | int) -> int:
        if isinstance(key, str):
            if key in self.names:
                return self.names.index(key)
            raise InputError(f"there is no contact {key!r}{suggest(key, self.names, 'contacts')}")
        if isinstance(key, int | np.integer):
            if not -len(self.names) <= key < len(self.names):
                raise InputError(f"there is no contact number {key}, only {len(self.names)} from 0 on")
            return range(len(self.names))[key]
        i = number_of(key, self.contacts)
        if i is None:
            raise InputError("this contact is not one of those of the solver: pass the same object")
        return i

    def _only(self, name: str) -> ContactValues:
        if len(self.names) != 1:
            raise AttributeError(
                f"'{name}' belongs to a contact and there are {len(self.names)} of them "
                f"({', '.join(self.names)}): write result['{self.names[0]}'].{name}"
            )
        return self.values[0]
