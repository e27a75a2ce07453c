#!/usr/bin/env python3
"""Are the costs that scripts/measure_costs.py fits the ones that were planted?  usage: costs_test.py"""

import pathlib
import random
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "scripts"))
import measure_costs  # noqa: E402


def points(costs, noise=0.0, count=30, time=None):
    """Points of random counts whose time is the sum of the planted costs, or what `time` says."""
    draw = random.Random(3)
    made = []
    for _ in range(count):
        counts = (draw.randint(10_000, 200_000), draw.randint(100_000, 900_000), draw.randint(1, 1_500_000), draw.randint(500_000, 9_000_000))
        total = time(counts) if time else sum(c * n for c, n in zip(costs, counts))
        made.append((counts, total * draw.gauss(1, noise)))
    return made


class Costs(unittest.TestCase):
    def test_without_noise_they_are_found(self):
        planted = (100, 40, 9, 13)
        found, residual = measure_costs.fit(points(planted))
        for cost, right in zip(found, planted):
            self.assertAlmostEqual(cost, right, delta=1e-6)
        self.assertLess(residual, 1e-9)

    def test_the_intervals_hold_them(self):
        planted = (100, 40, 9, 13)
        noisy = points(planted, noise=0.03)
        low, high = measure_costs.intervals(noisy)
        self.assertEqual([a <= right <= b for a, right, b in zip(low, planted, high)], [True] * 4)
        self.assertAlmostEqual(measure_costs.fit(noisy)[1], 0.03, delta=0.015)

    def test_none_is_below_0(self):
        # a plain fit would give the empty region -5
        found, _ = measure_costs.fit(points((100, 40, -5, 13), noise=0.01))
        self.assertTrue((found >= 0).all())
        self.assertEqual(found[2], 0)

    def test_another_law_has_a_large_residual(self):
        _, residual = measure_costs.fit(points(None, time=lambda n: n[1] * n[3] ** 2 / n[0]))
        self.assertGreater(residual, 0.2)

    def test_the_place_without_a_fetch_is_in_the_shader(self):
        contract = (measure_costs.experiment_runs.ROOT / "shaders/contract.glsl").read_text(encoding="utf-8")
        self.assertEqual(contract.count(measure_costs.FIELD), 1)


if __name__ == "__main__":
    unittest.main()
