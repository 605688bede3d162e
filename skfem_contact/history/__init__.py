"""The way through loads: steps, cuts, states, results.

* `read`: the user's step as loads;
* `load_step`: from where to where, one attempt, how far it has come; `energy`: what friction took;
* `stepper`, `placing`, `wearing`, `cutting`: one attempt; on the pairing of its own answer; with what
  it wears off; in smaller steps;
* `grip`, `nearest`, `indifference`, `finding`: bodies whose place nothing decides, and the answer;
* `second_order`: whether rigid bodies roll or lean further than small sliding has them;
* `answering`, `failure`: from a load case to a result, or to an error in words;
* `recovery`, `yielded`: displacements when asked for; the results of a history that fails;
* `checkpoint`: states on disk;
* `problem_setup`, `variants`, `solver`: what a solver is made of, solvers that are made of it, and load
  steps: what users hold; `dry_run`, `progress`: what it says before it solves and meanwhile;
* `body_words`: what of a body may be other than meant;
* `thresholds`: numbers, and where they come from.
"""
