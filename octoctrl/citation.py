"""What to cite, in BibTeX: octoctrl, the arm and behaviours that it plans for, and the solvers."""

from octoctrl import __version__

OCTOCTRL = f"""@software{{octoctrl,
  author  = {{{{The octoctrl developers}}}},
  title   = {{octoctrl: planning muscle activations of a soft octopus arm in the language of topology}},
  version = {{{__version__}}},
  year    = {{2026}}
}}"""
ARM = """@article{tekinalp2024topology,
  author  = {Tekinalp, Arman and Naughton, Noel and Kim, Seung Hyun and others},
  title   = {Topology, dynamics, and control of a muscle-architected soft arm},
  journal = {Proceedings of the National Academy of Sciences},
  year    = {2024}
}"""
CASADI = """@article{andersson2019casadi,
  author  = {Andersson, Joel A. E. and Gillis, Joris and Horn, Greg and Rawlings, James B. and Diehl, Moritz},
  title   = {{CasADi}: a software framework for nonlinear optimization and optimal control},
  journal = {Mathematical Programming Computation},
  volume  = {11},
  pages   = {1--36},
  year    = {2019}
}"""
DAQP = """@article{arnstroem2022daqp,
  author  = {Arnstr{\\"o}m, Daniel and Bemporad, Alberto and Axehill, Daniel},
  title   = {A dual active-set solver for embedded quadratic programming using recursive {LDL}' updates},
  journal = {IEEE Transactions on Automatic Control},
  volume  = {67},
  number  = {8},
  pages   = {4362--4369},
  year    = {2022}
}"""

CITATION = "\n".join((OCTOCTRL, ARM, CASADI, DAQP))
"""For a paper that plans with octoctrl."""
