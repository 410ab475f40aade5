"""What is counted of exact surfaces."""

import math

from naisr_model.benchmark.surfaces import evaluations


def test_evaluations_are_counted():
    asked = []

    def sphere(points):
        asked.append(len(points))
        return ((points**2).sum(axis=1) ** 0.5 - 0.5).astype("float32")

    assert evaluations(sphere, 64) == sum(asked)
    assert math.log2(evaluations(sphere, 128) / evaluations(sphere, 64)) < 2.2
