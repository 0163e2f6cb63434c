"""Which model the config names: its parameters, the model itself, what it grows to, and how that becomes a map to drive in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from common.errors import ConfigError
from services.planner.config import PlannerConfig
from services.planner.core.cognitive_map import CognitiveMap
from services.planner.core.gamma_som import GammaSom, GammaSomParameters
from services.planner.core.gng import GasParameters, GrowingNeuralGas
from services.planner.core.models import MapModel
from services.planner.core.som import SelfOrganisingMap, SomParameters
from services.planner.offline.config import GammaSomConfig, MapConfig, SomConfig
from services.planner.offline.motions import Samples

__all__ = ["gas_parameters", "grow", "model_of", "parameters_of"]


def parameters_of(config: PlannerConfig) -> MapConfig | SomConfig | GammaSomConfig:
    """The section of the chosen model: all that its training depends on beside the samples."""
    if config.model == "som":
        return config.som
    return config.gamma_som if config.model == "gamma_som" else config.map


def model_of(config: PlannerConfig) -> MapModel:
    """The chosen model, not trained yet.

    Raises:
        ConfigError: parameters that do not go together; names the section.
    """
    make: dict[str, Callable[[PlannerConfig], MapModel]] = {"gng": _gas, "som": _som, "gamma_som": _gamma_som}
    try:
        return make[config.model](config)
    except ValueError as error:
        raise ConfigError(f"[planner.{config.model}]: {error}", facts={"model": config.model}) from None


def grow(config: PlannerConfig, samples: Samples, progress: Callable[[float], None]) -> CognitiveMap:
    """What the chosen model makes of the samples, before anything is checked for collisions; the same bytes each time."""
    return model_of(config).fit(samples.q_rad, samples.starts, parameters_of(config).seed, progress).to_map()


def gas_parameters(config: MapConfig) -> GasParameters:
    """How a gas with this config learns."""
    return GasParameters(config.insert_every, config.e_best, config.e_neighbour, config.alpha, config.decay, config.max_age)


def _gas(config: PlannerConfig) -> MapModel:
    return GrowingNeuralGas(gas_parameters(config.map), config.map.n_neurons)


def _som(config: PlannerConfig) -> MapModel:
    c = config.som
    rule = SomParameters.of(c.rows, c.columns, config.motions.n_samples, c.training, c.n_neighbours)
    radius_start_steps = c.radius_start_steps or rule.radius_start_steps
    return SelfOrganisingMap(
        replace(
            rule,
            radius_start_steps=radius_start_steps,
            radius_middle_steps=c.radius_middle_steps or max(c.radius_end_steps, radius_start_steps / 4.0),
            radius_end_steps=c.radius_end_steps,
            epochs_rough=c.epochs_rough or rule.epochs_rough,
            epochs_fine=c.epochs_fine or rule.epochs_fine,
            rate_rough=c.rate_rough,
            rate_fine=c.rate_fine,
            signals_per_unit=c.signals_per_unit,
        )
    )


def _gamma_som(config: PlannerConfig) -> MapModel:
    c = config.gamma_som
    rule = GammaSomParameters.of(c.rows, c.columns, c.n_neighbours)
    return GammaSom(
        replace(
            rule,
            n_contexts=c.n_contexts,
            beta=c.beta,
            a_w=c.a_w,
            epochs=c.epochs,
            rate_start=c.rate_start,
            rate_end=c.rate_end,
            sigma_start_steps=c.sigma_start_steps or max(c.sigma_end_steps, rule.sigma_start_steps),
            sigma_end_steps=c.sigma_end_steps,
        )
    )
