"""Prepares a CARLA world for one segment, and puts it back as it was, whatever happens (experimental)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import Any

from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.data.extras import install
from jeat_graph.simulation.carla.config import TOWN, CarlaConfig
from jeat_graph.simulation.scenario import Scenario

_TM_PORT = 8000
_ANSWER_S = 5.0  # a server that runs answers within this


def client_api() -> Any:
    """Return the module `carla`.

    Raises:
        ConfigError: it is not installed.
    """
    try:
        import carla
    except ImportError:
        raise ConfigError(f"--sensors carla needs {install('carla')} (Python 3.10 to 3.12)") from None
    return carla


def connect(api: Any, host: str, port: int, timeout_s: float) -> Any:
    """Connect to a server and load the town, if it is not there already.

    Returns:
        `carla.Client`.

    Raises:
        DataError: no server answers there.
    """
    client = api.Client(host, port)
    client.set_timeout(min(_ANSWER_S, timeout_s))
    try:
        client.get_server_version()
        client.set_timeout(timeout_s)  # to load a town takes longer than to say hello
        if client.get_world().get_map().name.rsplit("/", 1)[-1] != TOWN:
            client.load_world(TOWN)
    except RuntimeError as error:
        raise DataError(f"CARLA: no server at {host}:{port}: {' '.join(str(error).split())}") from None
    return client


class CarlaSession:
    """What a segment needs of the world; made by `open_session`.

    Attributes:
        api: the module `carla`.
        world: `carla.World`, in synchronous mode.
        traffic: `carla.TrafficManager`, in synchronous mode.
    """

    def __init__(self, api: Any, world: Any, traffic: Any, stack: ExitStack) -> None:
        self.api = api
        self.world = world
        self.traffic = traffic
        self._stack = stack

    def own(self, actor: Any, stop: bool = False) -> Any:
        """Have an actor destroyed when the session ends; a sensor is stopped before."""
        self._stack.callback(_destroy, actor, stop)
        return actor

    def drive(self, vehicle: Any) -> None:
        """Hand a vehicle to the Traffic Manager."""
        vehicle.set_autopilot(True, _TM_PORT)


@contextmanager
def open_session(
    api: Any, client: Any, scenario: Scenario, config: CarlaConfig, seed: int
) -> Iterator[CarlaSession]:
    """Prepare clock, weather and lights, and put settings, weather and lights back at the end.

    Args:
        api: the module `carla`.
        client: `carla.Client`.
        scenario: its light says day, night, or night without street lamps.
        config: settings.
        seed: of the Traffic Manager.
    """
    world = client.get_world()
    with ExitStack() as stack:
        # Callbacks run in reverse: actors go first, and the server gets its own clock back last.
        settings, weather = world.get_settings(), world.get_weather()
        stack.callback(world.apply_settings, settings)
        stack.callback(world.set_weather, weather)
        traffic = client.get_trafficmanager(_TM_PORT)
        stack.callback(traffic.set_synchronous_mode, False)
        wanted = world.get_settings()
        wanted.synchronous_mode = True
        wanted.fixed_delta_seconds = config.tick_s
        wanted.no_rendering_mode = False
        world.apply_settings(wanted)
        traffic.set_synchronous_mode(True)
        traffic.set_random_device_seed(seed)
        _set_light(api, world, scenario, config, stack)
        yield CarlaSession(api, world, traffic, stack)


def is_day(scenario: Scenario, config: CarlaConfig) -> bool:
    """Whether the scenario is by day."""
    return scenario.light.ambient_lux > config.day_lux


def _set_light(api: Any, world: Any, scenario: Scenario, config: CarlaConfig, stack: ExitStack) -> None:
    day = is_day(scenario, config)
    weather = api.WeatherParameters()
    weather.sun_altitude_angle = config.day_sun_deg if day else config.night_sun_deg
    world.set_weather(weather)
    manager = world.get_lightmanager()
    if hasattr(manager, "set_day_night_cycle"):
        manager.set_day_night_cycle(False)  # else the server switches lamps by the sun's altitude
        stack.callback(manager.set_day_night_cycle, True)
    street = api.LightGroup.Street
    stack.callback(manager.turn_on, manager.get_turned_on_lights(street))
    stack.callback(manager.turn_off, manager.get_turned_off_lights(street))
    lamps = manager.get_all_lights(street)
    if not day and scenario.light.lamp_candela > 0.0:
        manager.turn_on(lamps)
    else:
        manager.turn_off(lamps)


def _destroy(actor: Any, stop: bool) -> None:
    # One actor that is gone already must not keep the others from being cleared away.
    with suppress(RuntimeError):
        if stop:
            actor.stop()
    with suppress(RuntimeError):
        actor.destroy()
