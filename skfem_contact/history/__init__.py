"""The way through loads: steps, cuts, states, results.

* `read`: the user's step as loads; `attempt`, `stepping`: from one state to the next;
* `indifference`: bodies whose place nothing decides;
* `load_step`, `recovery`, `yielded`: from loads to a result; displacements when asked for;
* `checkpoint`: states on disk;
* `solver`, `dry_run`: the object that users hold, and what it says before solving.
"""
