"""The monitor as a managed ROS 2 node: parameters, life cycle and diagnostics around a `Monitoring`.

ros2 run collision_monitor monitor --ros-args -p horizon:=1.0 -p record:=run.mcap
"""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

from rclpy.node import Node

from collision_monitor import warm_up
from collision_monitor._jit.compilation import FUNCTIONS, compiling_nothing, telling_compilation
from collision_monitor.alerts.rules import Rules
from collision_monitor.errors import CollisionMonitorError
from collision_monitor.pipeline.topics import NODE
from collision_monitor.ros.bond import ManagerBond
from collision_monitor.ros.entities import Entities
from collision_monitor.ros.health import health
from collision_monitor.ros.health.diagnostics import Diagnostics
from collision_monitor.ros.managed import Managed
from collision_monitor.ros.monitor.live_rules import LiveRules
from collision_monitor.ros.monitor.live_settings import LiveSettings
from collision_monitor.ros.monitor.monitoring import Monitoring
from collision_monitor.ros.parameters import begin_node, read_monitor_parameters
from collision_monitor.ros.process import StopRequest
from collision_monitor.settings.profile import Profile


class MonitorNode(Managed, Node):
    """The node `object_monitor`. Its services and topics are there once the kernels are loaded.

    Raises InputError or ProfileError for impossible parameters.
    """

    def __init__(self, stop: StopRequest) -> None:
        begin_node(self, NODE)
        try:
            self.settings = read_monitor_parameters(self)
        except CollisionMonitorError:
            self.destroy_node()
            raise
        self._profile = self.settings.profile
        self._live_settings = LiveSettings(self, self._profile, self._on_settings)
        self._rules = self.settings.rules
        self._live_rules = LiveRules(self, self._on_rules)
        self._warm_up(stop)
        self._monitoring: Monitoring | None = None
        self._resources = ExitStack()  # of the configuration
        self._configurations = 0
        self._bond = ManagerBond(self)
        Managed.__init__(self)
        self._history = health.LastReports()
        self._diagnostics = Diagnostics(self, self._health, self.settings.diagnostics)

    def _warm_up(self, stop: StopRequest) -> None:
        """Load or compile the kernels before messages arrive, because messages that wait for the compiler are lost.

        Those that the settings do not need now are loaded too, for a later change, unless they were never compiled.
        """
        total = FUNCTIONS["monitor"] + (FUNCTIONS["options"] if self._profile.uncertainty else 0)
        with stop.ending(), telling_compilation(self.get_logger().info, total, every=10.0):
            warm_up.warm_up_monitor(self._profile)
            if self._rules.rules:
                warm_up.warm_up_alerts()
        for load in (warm_up.warm_up_monitor, warm_up.warm_up_alerts):
            with stop.ending(), compiling_nothing():
                load()

    # -- life cycle

    def configure(self) -> None:
        """Begin to monitor and to record."""
        self._configurations += 1
        self._resources.callback(Entities(self).destroy_new)
        self._live_rules.subscribe()
        record = numbered(self.settings.record, self._configurations)
        self._monitoring = Monitoring(self, self._resources, self.settings, self._profile, self._rules, record)

    def activate(self) -> None:
        """Begin to publish the answers."""
        assert self._monitoring is not None
        self._monitoring.activate()
        if not self.settings.autostart:
            self._bond.form()

    def deactivate(self) -> None:
        """Stop to publish. The monitoring and the recording go on."""
        assert self._monitoring is not None
        self._bond.dissolve()
        self._monitoring.deactivate()

    def cleanup(self) -> None:
        """Forget all objects and complete the recording."""
        self._monitoring = None
        self._history = health.LastReports()
        self._bond.dissolve()
        self._resources.close()

    # -- while it runs

    def _on_settings(self, profile: Profile) -> None:
        self._profile = profile
        if self._monitoring is not None:
            self._monitoring.change_settings(profile)

    def _on_rules(self, rules: Rules) -> None:
        self._rules = rules
        if self._monitoring is not None:
            self._monitoring.change_rules(rules)

    def _health(self) -> list[health.Report]:
        """Return what the diagnostics report."""
        facts = None if self._monitoring is None else self._monitoring.facts()
        return health.reports(self.state, self.failure, facts, self._history)

    # -- the end of the process

    def save(self) -> None:
        """Finish the session file, from another thread: this one is stuck and the process is about to end."""
        if self._monitoring is not None:
            self._monitoring.save()

    def close(self) -> None:
        """Publish and record the last status, finish the session file and shut down."""
        self.finish()
        self._diagnostics.publish()
        self.destroy_node()


def numbered(path: str, configuration: int) -> str:
    """Return the path of the session of a configuration: `run.mcap`, `run_2.mcap`, …; no recording is overwritten."""
    if not path or configuration == 1:
        return path
    given = Path(path)
    return str(given.with_name(f"{given.stem}_{configuration}{given.suffix}"))
