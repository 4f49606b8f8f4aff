"""The gate of speeds: what is slower than noise fails, what is not does not."""

import importlib.util
from types import ModuleType

import numpy as np
import pytest

from tests.places import ROOT


@pytest.fixture(scope="module")
def gate() -> ModuleType:
    found = importlib.util.spec_from_file_location("bench_gate", ROOT / "tools" / "bench_gate.py")
    assert found is not None
    assert found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


def rounds(factor: float, noise: float, seed: int) -> list[dict[str, float]]:
    rng = np.random.default_rng(seed)
    return [{"a": factor * (1 + abs(rng.normal(0, noise))), "b": 1.0} for _ in range(7)]


@pytest.mark.parametrize(("factor", "slower"), [(0.5, False), (1.0, False), (1.05, False), (1.3, True), (2.0, True)])
def test_what_is_slower_than_noise_fails(gate: ModuleType, factor: float, slower: bool) -> None:
    for seed in range(20):
        found = gate.judged(rounds(1.0, 0.03, seed), rounds(factor, 0.03, 100 + seed))
        assert [(row[0], row[-1]) for row in found] == [("a", slower), ("b", False)]
        assert found[0][2] <= found[0][1] <= found[0][3]


def test_a_new_job_is_not_judged(gate: ModuleType) -> None:
    assert [row[0] for row in gate.judged([{"a": 1.0}], [{"a": 1.0, "new": 9.0}])] == ["a"]
