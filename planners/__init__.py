"""The reduced world: reduced model, identification, primitives, trajectory optimisation and feedback design."""

if __name__ != "octoctrl.planners":
    raise ImportError("import octoctrl.planners, not planners: two names for one module would make two copies of every class")
