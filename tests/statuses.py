"""The numbers that `status` has for the points of a result, as its documentation says."""

OPEN, STICK, SLIP = 0, 1, 2
