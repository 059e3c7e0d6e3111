"""The physical world: what an arm is, what moves it, and what is measured on it.

`arm`, `muscles` and `scene` describe; `templates` and their composition, an `activation`, are what a controller may do; `plant` moves the
arm and gives a `recording`; `topology` measures a `trace` of link, writhe and twist on it. `rod` is the passive elastic rod beneath the
plant. Modules called ``*_kernels`` and `stepping` hold compiled code. Nothing here knows of planners or tasks. Background:
docs/physics.md and docs/topology.md.
"""

if __name__ != "octoctrl.sim":
    raise ImportError("import octoctrl.sim, not sim: two names for one module would make two copies of every class")
