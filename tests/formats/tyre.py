"""What a tyre library that others wrote makes of a property file: tyre.py FILE.tir, on standard input lines of slip and normal force.

Prints the longitudinal force of each as the Magic Formula 5.2 of lumos has it, read by lumos' own reader. Its other numerical backends are not
installed, for they are not asked.
"""

import sys
from unittest import mock

for backend in ["jax", "jax.numpy", "jax.config", "jax.experimental", "jax.tree_util", "casadi", "matplotlib", "matplotlib.pyplot", "cyipopt"]:
    sys.modules[backend] = mock.MagicMock()

import numpy as np  # noqa: E402
from lumos.models.tires.pacejka import MF52  # noqa: E402
from lumos.models.tires.utils import create_params_from_tir_file  # noqa: E402

slip, load = np.loadtxt(sys.stdin, ndmin=2).T
# What a file on longitudinal force does not have is the library's own tyre's.
parameters = {**MF52.get_default_params(), **create_params_from_tir_file(sys.argv[1])}
model = MF52()
model._params = parameters
still = np.zeros_like(slip)
result = model.forward({"Fz": load, "kappa": -slip, "alpha": still, "gamma": still, "vx": still + 20.0})
for force in result.outputs["Fx"]:
    print(repr(float(force)))
