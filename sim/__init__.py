"""The physical world: arm, muscles, scene, activation, plant and topology measurement."""

if __name__ != "octoctrl.sim":
    raise ImportError("import octoctrl.sim, not sim: two names for one module would make two copies of every class")
