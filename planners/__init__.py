"""The reduced world: what a planner believes about the arm, and how it chooses activations.

`asking` says what should hold when and has the primitives that may bring it about; `model` is the small model, whose factors `fitting`
adjusts to runs of a plant; `solving` refuses what cannot be, optimises and gives a plan; `following` tracks it. Nothing here knows the
plant's equations: only arm, scene, activation, topology and recordings are shared. Background: docs/planning.md and docs/feedback.md.
"""

if __name__ != "octoctrl.planners":
    raise ImportError("import octoctrl.planners, not planners: two names for one module would make two copies of every class")
