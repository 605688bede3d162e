"""The nonlinear iterations: which points are open, stick and slip.

* `step`: what loops are given and return;
* `projection`, `rules`, `plane_rules`, `guided`: how points change, where supports prescribe slips;
* `tangent`: the linear conditions of an iteration; `pace`, `search`: how far one goes at a time;
* `active_set`, `fictitious`, `table`: the three loops, and each by its name and limits;
* `multipliers`: springs that lose their strain, where forces are not unique;
* `unneeded`: friction that is not needed there;
* `driver`: what counts, logs and stops them;
* `starts`, `lemke`, `pulled`, `proximal`, `steep`: where iterations begin, and what is carried at most;
* `anderson`: secants for fixed points;
* `thresholds`: numbers, and where they come from.
"""
