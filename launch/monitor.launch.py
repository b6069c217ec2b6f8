"""Start the monitor alone, with the parameters of config/monitor.yaml.

ros2 launch collision_monitor monitor.launch.py record:=run.mcap
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    parameters = PathJoinSubstitution([FindPackageShare("collision_monitor"), "config", "monitor.yaml"])
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "params", default_value=parameters, description="YAML file with the parameters of the monitor"
            ),
            DeclareLaunchArgument(
                "record", default_value="", description="path of the session to record: a .mcap file or a folder"
            ),
            DeclareLaunchArgument(
                "sources", default_value="", description="sources file: topics of other programs to monitor"
            ),
            Node(
                package="collision_monitor",
                executable="monitor",
                name="object_monitor",
                output="screen",
                parameters=[
                    LaunchConfiguration("params"),
                    {name: ParameterValue(LaunchConfiguration(name), value_type=str) for name in ("record", "sources")},
                ],
            ),
        ]
    )
