"""Settings that change while the monitor runs: `ros2 param set /object_monitor profile fast`.

Setting `profile` sets the parameters of all settings in the profile, so that the parameters show the settings in force.
Each change is checked as a whole before any part of it takes effect.
"""

from __future__ import annotations

from collections.abc import Callable

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from collision_monitor.errors import ProfileError
from collision_monitor.pipeline.settings_event import PROFILE
from collision_monitor.ros.parameters import plain
from collision_monitor.settings.profile import Profile


class LiveSettings:
    """Follows the node's parameters. change: called with the profile that is in force from now on."""

    def __init__(self, node: Node, profile: Profile, change: Callable[[Profile], None]) -> None:
        self._profile = profile
        self._change = change
        self._settings = {setting.name: setting for setting in Profile.fields()}
        node.add_pre_set_parameters_callback(self._complete)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)

    def _complete(self, parameters: list[Parameter]) -> list[Parameter]:
        """Add the parameters that a profile sets, and convert a whole number if the setting is a decimal one."""
        given = {each.name: self._as_meant(each) for each in parameters}
        named: dict[str, Parameter] = {}
        if isinstance(chosen := given[PROFILE].value if PROFILE in given else None, str):
            try:
                changes = self._profile.differences(self._profile.switched(chosen))
            except ProfileError:
                return parameters  # `_check` reports the reason
            named = {name: Parameter(name, value=value) for name, value in changes.items() if name in self._settings}
        return list({**named, **given}.values())

    def _as_meant(self, parameter: Parameter) -> Parameter:
        setting = self._settings.get(parameter.name)
        if setting is not None and setting.type is float and type(parameter.value) is int:
            return Parameter(parameter.name, value=float(parameter.value))
        return parameter

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            self._changed(parameters)
        except ProfileError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply(self, parameters: list[Parameter]) -> None:
        profile = self._changed(parameters)
        if profile != self._profile:
            self._profile = profile
            self._change(profile)

    def _changed(self, parameters: list[Parameter]) -> Profile:
        """Return the profile with these parameters. Raises ProfileError."""
        values = {each.name: each.value for each in parameters}
        profile = self._profile.switched(values[PROFILE]) if PROFILE in values else self._profile
        settings = {name: plain(values[name], each) for name, each in self._settings.items() if name in values}
        return profile.replace(**settings) if settings else profile
