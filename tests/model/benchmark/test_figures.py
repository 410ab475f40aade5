"""A figure and its target."""

from naisr_model.benchmark.figures import Figure


def test_a_verdict_follows_the_target():
    more, less = Figure("a", "", "", at_least=2.0), Figure("b", "ms", "", at_most=33.0)
    assert more.target == "≥ 2" and less.target == "≤ 33 ms"
    assert [more.verdict(value) for value in (1.9, 2.0)] == ["no", "yes"]
    assert [less.verdict(value) for value in (33.0, 34.0)] == ["yes", "no"]
    assert Figure("c", "s", "").verdict(1.0) == ""
