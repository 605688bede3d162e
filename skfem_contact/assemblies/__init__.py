"""Assemblies: many bodies read from files, their contacts found, bolts, and reports of joints.

* `reading`: bodies from files of tagged meshes;
* `finding`: where the boundaries of all bodies face each other, pairs of patches from that, and
  contacts from these;
* `bolt`: pretension sections of bolts, by force or stretch, then locked;
* `joints`: tables of joints and of load cases.
"""

from typing import TYPE_CHECKING

from skfem_contact.records import entrances

if TYPE_CHECKING:
    from skfem_contact.assemblies.bolt import BoltValues as BoltValues
    from skfem_contact.assemblies.finding import FoundContact as FoundContact
    from skfem_contact.assemblies.finding import FoundContacts as FoundContacts
    from skfem_contact.assemblies.joints import Joint as Joint
    from skfem_contact.assemblies.joints import Joints as Joints
    from skfem_contact.assemblies.joints import LoadCases as LoadCases

__all__ = ["BoltValues", "FoundContact", "FoundContacts", "Joint", "Joints", "LoadCases"]

__getattr__, __dir__ = entrances(
    __name__,
    __all__,
    {"bolt": "BoltValues", "finding": "FoundContact FoundContacts", "joints": "Joint Joints LoadCases"},
)
