"""Assemblies: what holds bodies together, and what is told of it.

* `bolt`: pretension sections of bolts, by force or stretch, then locked;
* `joints`: tables of joints and of load cases.
"""
