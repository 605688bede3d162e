"""Assemblies of many bodies: what is done before and after a contact problem is solved.

* `reading`: bodies from files of tagged meshes;
* `facing`: the boundaries of all bodies, and where they face each other; `drafting`: pairs of
  patches from that; `finding`: contacts from these; `picture` of them;
* `named`: sequences that know their members by name;
* `thresholds`: numbers, and where they come from.
"""
