"""Ten thousand drawn values have the distribution that the file asks for."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from crowdsim.scenario.people.draws import draw_spread, quantiles
from crowdsim.scenario.schema.spreads import Spread

COUNT = 10_000
ASKED = {
    "normal": ({"mean": 1.34, "sd": 0.26}, stats.norm(1.34, 0.26)),
    "uniform": ({"uniform": (10.0, 100.0)}, stats.uniform(10.0, 90.0)),
    "lognormal": ({"lognormal": {"mu": 3.95, "sigma": 0.84}}, stats.lognorm(0.84, scale=np.exp(3.95))),
    "long tail": ({"lognormal": {"mu": 4.586, "sigma": 0.967}}, stats.lognorm(0.967, scale=np.exp(4.586))),
    "gamma": ({"gamma": {"shape": 1.291, "scale": 103.901}}, stats.gamma(1.291, scale=103.901)),
    "weibull": ({"weibull": {"shape": 1.195, "scale": 139.285}}, stats.weibull_min(1.195, scale=139.285)),
}


@pytest.mark.parametrize("kind", ASKED)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_stratified_values_have_mean_deviation_and_shape_of_the_distribution(kind: str, seed: int) -> None:
    keys, asked = ASKED[kind]
    drawn = draw_spread(Spread.model_validate({**keys, "stratified": True}), COUNT, np.random.default_rng(seed))
    assert abs(drawn.mean() / asked.mean() - 1.0) < 0.01
    assert abs(drawn.std() / asked.std() - 1.0) < 0.01
    assert stats.kstest(drawn, asked.cdf).pvalue > 0.05
    # In random order: who comes first tells nothing.
    assert abs(np.corrcoef(np.arange(COUNT), drawn)[0, 1]) < 0.05


@pytest.mark.parametrize("kind", ASKED)
@pytest.mark.parametrize("count", [2, 4, 10, 100])
def test_few_stratified_values_have_the_deviation_on_average(kind: str, count: int) -> None:
    keys, asked = ASKED[kind]
    spread = Spread.model_validate({**keys, "stratified": True})
    many = [draw_spread(spread, count, np.random.default_rng(seed)) for seed in range(12)]
    squares = np.mean([((drawn - asked.mean()) ** 2).mean() for drawn in many])
    assert np.sqrt(squares) == pytest.approx(asked.std(), rel=0.05)
    for drawn in many:
        # One from each part.
        assert (np.sort(np.floor(asked.cdf(drawn) * count * (1 - 1e-9)))[1:-1] == np.arange(1, count - 1)).all()


@pytest.mark.parametrize("kind", ASKED)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_independent_values_have_the_distribution(kind: str, seed: int) -> None:
    keys, asked = ASKED[kind]
    drawn = draw_spread(Spread.model_validate(keys), COUNT, np.random.default_rng(seed))
    assert abs(drawn.mean() / asked.mean() - 1.0) < 4.0 * asked.std() / asked.mean() / np.sqrt(COUNT)
    # The deviation has a standard error of its own, of 4.8 % for the long tail, however it is drawn.
    error = np.sqrt((float(asked.stats("k")) + 2.0) / (4.0 * COUNT))
    assert abs(drawn.std() / asked.std() - 1.0) < 4.0 * error
    assert stats.kstest(drawn, asked.cdf).pvalue > 0.05


@pytest.mark.parametrize("kind", ASKED)
def test_what_a_character_draws_does_not_depend_on_how_many_come_after_it(kind: str) -> None:
    spread = Spread.model_validate(ASKED[kind][0])
    few, many = (draw_spread(spread, count, np.random.default_rng(7)) for count in (10, 1000))
    np.testing.assert_array_equal(few, many[:10])


@pytest.mark.parametrize("stratified", [True, False])
def test_bounds_cut_a_distribution_and_leave_its_shape(stratified: bool) -> None:
    # Response times of MSC.1/Circ.1533 by night: from 400 to 700 s.
    keys = {"lognormal": {"mu": 3.95, "sigma": 0.84}, "min": 20.0, "max": 100.0, "stratified": stratified}
    drawn = draw_spread(Spread.model_validate(keys), COUNT, np.random.default_rng(4))
    asked = ASKED["lognormal"][1]
    low, high = asked.cdf([20.0, 100.0])
    assert drawn.min() >= 20.0
    assert drawn.max() <= 100.0
    assert stats.kstest(drawn, lambda x: (asked.cdf(x) - low) / (high - low)).pvalue > 0.05


def test_a_mix_has_its_shares_and_bounds() -> None:
    parts = [{"share": 3.0, "mean": 1.0}, {"share": 1.0, "uniform": (1.5, 2.5)}]
    drawn = draw_spread(Spread.model_validate({"mix": parts, "max": 2.0}), COUNT, np.random.default_rng(5))
    assert set(drawn[drawn < 1.5]) == {1.0}
    assert abs((drawn == 1.0).mean() - 0.75) < 0.015
    assert stats.kstest(drawn[drawn > 1.0], stats.uniform(1.5, 0.5).cdf).pvalue > 0.05


def test_a_table_has_the_shares_and_bands_of_the_guideline() -> None:
    spread = Spread(table="imo_passengers", stratified=True)
    drawn = draw_spread(spread, COUNT, np.random.default_rng(6))
    assert drawn.min() >= 0.37
    assert drawn.max() <= 1.85
    shares = np.array([7, 7, 16, 10, 10, 7, 7, 16, 10, 10]) / 100
    least = np.array([0.93, 0.71, 0.56, 0.43, 0.37, 1.11, 0.97, 0.84, 0.64, 0.55])
    most = np.array([1.55, 1.19, 0.94, 0.71, 0.61, 1.85, 1.62, 1.40, 1.06, 0.91])
    assert drawn.mean() == pytest.approx((shares * (least + most) / 2).sum(), rel=0.001)
    assert (drawn > 1.62).mean() == pytest.approx(0.07 * (1.85 - 1.62) / (1.85 - 1.11), abs=0.001)


def test_what_lies_off_its_bounds_is_set_to_the_nearer_one() -> None:
    keys = {"lognormal": {"mu": 0.0, "sigma": 0.1}, "min": 50.0, "max": 60.0}
    assert set(draw_spread(Spread.model_validate(keys), 5, np.random.default_rng(1))) == {50.0}


@settings(deadline=None)
@given(
    kind=st.sampled_from(sorted(ASKED)),
    low=st.floats(-10.0, 200.0),
    width=st.floats(0.0, 300.0),
    count=st.integers(0, 30),
    stratified=st.booleans(),
)
def test_values_stay_within_bounds(kind: str, low: float, width: float, count: int, stratified: bool) -> None:
    keys = {**ASKED[kind][0], "max": low + width, "stratified": stratified}
    if kind != "normal" or low <= 1.34 <= low + width:
        keys["min"] = low
    elif low + width < 1.34:
        return
    drawn = draw_spread(Spread.model_validate(keys), count, np.random.default_rng(1))
    assert drawn.shape == (count,)
    assert (drawn <= low + width).all()
    assert "min" not in keys or (drawn >= low).all()


@pytest.mark.parametrize("kind", ASKED)
def test_quantiles_ascend(kind: str) -> None:
    found = quantiles(Spread.model_validate(ASKED[kind][0]), np.linspace(0.0, 1.0, 1001))
    assert np.isfinite(found).all()
    assert (np.diff(found) >= 0.0).all()
