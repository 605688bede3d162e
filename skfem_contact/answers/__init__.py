"""What an answer is and what can be said of it.

* `answer`, `result`, `values`, `fields`: the numbers, for all bodies and per contact;
* `certificate`: how well the discrete equations hold; `uniqueness`: whether there are other answers;
* `validity`: whether the model holds; `error`: how far the mesh may be off;
* `report`: all of it printed.
"""
