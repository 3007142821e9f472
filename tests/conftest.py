"""How the suite stays quick: compiled kernels are shared.

A path-tracing kernel is compiled for its `PathKey`, at 3 to 5 seconds each. Tests of whole pictures therefore go
through `pictures.picture`, which renders with `plan.everything()`: one kernel with all shapes, materials, lights and
lenses compiled in serves them all. Only `test_specialised.py` (what a plan's own kernel draws is what that one draws)
and the command line's tests compile others, a handful in all. AOV kernels take about 1 s, leaf functions less.
"""

import warp as wp

wp.config.log_level = wp.LOG_WARNING
