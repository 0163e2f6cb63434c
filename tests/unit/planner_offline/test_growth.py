"""The config names the model, and what it says reaches it."""

from __future__ import annotations

import msgspec
import pytest

from common.cell import load
from common.config import parse
from common.errors import ConfigError
from services.planner.config import PlannerConfig
from services.planner.core.gamma_som import GammaSom, GammaSomParameters
from services.planner.core.gng import GasParameters, GrowingNeuralGas
from services.planner.core.som import SelfOrganisingMap, SomParameters
from services.planner.offline.build import Job
from services.planner.offline.config import GammaSomConfig, SomConfig
from services.planner.offline.growth import model_of, parameters_of
from tests.support.cell import ur3_cell


def chosen(*overrides: str) -> PlannerConfig:
    return load(None, "planner", PlannerConfig, list(overrides))[1]


def test_the_defaults_are_the_models_own() -> None:
    gas, som, gamma = (model_of(chosen(f"planner.model={name}")) for name in ("gng", "som", "gamma_som"))
    assert isinstance(gas, GrowingNeuralGas) and gas.parameters == GasParameters() and gas.n_neurons == 10_000
    assert isinstance(som, SelfOrganisingMap) and som.parameters == SomParameters()
    assert isinstance(gamma, GammaSom) and gamma.parameters == GammaSomParameters()


def test_every_value_of_the_config_reaches_its_model() -> None:
    """Another value for any key, and another model is made; only the seed is handed to ``fit``."""
    other = {
        "som": SomConfig(
            rows=20, columns=30, n_neighbours=4, training="sequential", radius_start_steps=9.0, radius_middle_steps=2.0,
            radius_end_steps=0.5, epochs_rough=3, epochs_fine=5, rate_rough=0.4, rate_fine=0.1, signals_per_unit=50,
        ),
        "gamma_som": GammaSomConfig(
            rows=20, columns=30, n_neighbours=4, n_contexts=3, beta=0.5, a_w=0.6, epochs=7, rate_start=0.2, rate_end=0.1,
            sigma_start_steps=9.0, sigma_end_steps=0.5,
        ),
    }  # fmt: skip
    for name, section in other.items():
        model = model_of(msgspec.structs.replace(chosen(f"planner.model={name}"), **{name: section}))
        assert isinstance(model, SelfOrganisingMap | GammaSom)
        for key in set(section.__struct_fields__) - {"seed"}:
            assert getattr(section, key) != getattr(type(section)(), key), f"{key}: the case tests nothing"
            assert getattr(model.parameters, key) == getattr(section, key), key


def test_schedules_that_are_left_out_follow_the_lattice() -> None:
    som = model_of(chosen("planner.model=som", "planner.som.rows=16", "planner.som.columns=24", "planner.motions.n_samples=1000"))
    assert isinstance(som, SelfOrganisingMap)
    assert (som.parameters.radius_start_steps, som.parameters.radius_middle_steps, som.parameters.radius_end_steps) == (3.0, 1.0, 1.0)
    assert (som.parameters.epochs_rough, som.parameters.epochs_fine) == (4, 16)
    gamma = model_of(chosen("planner.model=gamma_som", "planner.gamma_som.rows=50", "planner.gamma_som.columns=20"))
    assert isinstance(gamma, GammaSom) and gamma.parameters.sigma_start_steps == 9.0


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (["planner.model=hopfield"], ["[planner]", "hopfield", "$.model"]),
        (["planner.som.colums=30"], ["[planner]", "colums", "$.som"]),
        (["planner.som.rows=1", "planner.som.columns=2"], ["[planner]", "1 x 2", "$.som"]),
        (["planner.gamma_som.rows=500", "planner.gamma_som.columns=500"], ["[planner]", "500 x 500", "$.gamma_som"]),
        (["planner.gamma_som.beta=1.0"], ["[planner]", "$.gamma_som.beta"]),
        (["planner.search=greedy"], ["[planner]", "greedy", "$.search"]),
    ],
)
def test_what_cannot_be_is_refused_with_place_and_value(overrides: list[str], words: list[str]) -> None:
    with pytest.raises(ConfigError) as caught:
        chosen(*overrides)
    assert all(word in caught.value.message for word in words), caught.value.message


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (["planner.model=som", "planner.som.radius_start_steps=0.5"], ["[planner.som]", "radii", "0.5"]),
        (["planner.model=gamma_som", "planner.gamma_som.rate_end=0.9"], ["[planner.gamma_som]", "rates", "0.9"]),
    ],
)
def test_parameters_that_do_not_go_together_are_refused_before_any_work(overrides: list[str], words: list[str]) -> None:
    with pytest.raises(ConfigError) as caught:
        Job.of(ur3_cell(), chosen(*overrides))
    assert all(word in caught.value.message for word in words), caught.value.message


def test_a_map_depends_on_the_parameters_of_its_own_model_alone() -> None:
    cell = ur3_cell()
    overrides = {"gng": "planner.map.max_age=60", "som": "planner.som.radius_end_steps=0.8", "gamma_som": "planner.gamma_som.beta=0.6"}
    paths = {name: Job.of(cell, chosen(f"planner.model={name}")).path for name in overrides}
    assert len(set(paths.values())) == 3
    for model, path in paths.items():
        for name, override in overrides.items():
            assert (Job.of(cell, chosen(f"planner.model={model}", override)).path == path) is (name != model), (model, override)
        assert Job.of(cell, chosen(f"planner.model={model}", "planner.extend.n_added=5")).path == path


def test_parameters_are_the_section_of_the_model() -> None:
    config = parse({"motions": msgspec.to_builtins(chosen().motions), "model": "som", "som": {"rows": 7}}, PlannerConfig, place="here")
    assert parameters_of(config) == SomConfig(rows=7)
