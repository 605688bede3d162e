"""Assemblies: many bodies read from files, their contacts found, bolts, and reports of joints.

* `reading`: bodies from files of tagged meshes;
* `facing`: the boundaries of all bodies, and where they face each other; `drafting`: pairs of
  patches from that; `finding`: contacts from these;
* `named`: sequences that know their members by name;
* `bolt`: pretension sections of bolts, by force or stretch, then locked;
* `joints`: tables of joints and of load cases;
* `thresholds`: numbers, and where they come from.
"""
