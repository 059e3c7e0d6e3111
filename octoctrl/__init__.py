"""octoctrl: plan the muscle activations of a soft arm in the language of topology, and verify them on a Cosserat simulator."""

from pathlib import Path

# In a source checkout `sim/` and `planners/` stand beside this folder; this makes them importable as octoctrl.sim and octoctrl.planners.
if (Path(__file__).parent.parent / "sim" / "arm.py").is_file():
    __path__.append(str(Path(__file__).parent.parent))

__version__ = "0.1.0"
