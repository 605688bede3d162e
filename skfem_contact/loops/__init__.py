"""The nonlinear iterations: which points are open, stick and slip.

* `step`: what loops are given and return;
* `rules`, `guided`: how points change, and where supports prescribe the slip;
* `loops`, `driver`: the three loops, and what counts, logs and stops them;
* `starts`, `lemke`: where iterations begin; `anderson`: secants for fixed points;
* `thresholds`: numbers, and where they come from.
"""
