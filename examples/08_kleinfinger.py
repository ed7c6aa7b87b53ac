"""Kleinfinger's six parameters and their transform, in both directions."""

import math

import numpy as np

from raff2urdf.raff.kleinfinger import Kleinfinger, parameters, transform

np.set_printoptions(precision=4, suppress=True)

# From father to link: Rz(gamma) Tz(epsilon) Rx(alpha) Tx(d) Rz(theta) Tz(r). Radians and metres.
elbow = Kleinfinger(gamma=0.0, epsilon=0.0, alpha=math.pi / 2, d=0.4, theta=math.radians(30), r=0.1)
T = transform(elbow)
print(T)
print("and back:", *(f"{name} {value:.4f}" for name, value in parameters(T)._asdict().items()))

# A link whose place is known otherwise, from CAD say: which six numbers does RAFF want? (degrees, millimetres)
placement = np.array([[0, 0, 1, 0.25], [1, 0, 0, 0.0], [0, 1, 0, 0.3], [0, 0, 0, 1]])
numbers = parameters(placement)
angles = {"gamma": numbers.gamma, "alpha": numbers.alpha, "theta": numbers.theta}
lengths = {"epsilon": numbers.epsilon, "d": numbers.d, "r": numbers.r}
words = [f"{name} {round(math.degrees(value), 6):zg}" for name, value in angles.items()]
words += [f"{name} {round(1000 * value, 6):zg}" for name, value in lengths.items()]
print("parameters {", *words, "}")
print(f"same placement: {np.allclose(transform(numbers), placement)}")
