"""The reduced world: what a planner believes about the arm, and how it chooses activations.

`task` says what should hold when; `schedule` has the primitives that may bring it about; `reduced` is the small model, whose factors
`identification` fits to runs of a plant; `reachability` refuses what cannot be; `trajectory` optimises and gives a `plan`; `feedback`
follows it. Nothing here knows the plant's equations: only arm, scene, activation and topology are shared. Background: docs/planning.md and
docs/feedback.md.
"""

if __name__ != "octoctrl.planners":
    raise ImportError("import octoctrl.planners, not planners: two names for one module would make two copies of every class")
