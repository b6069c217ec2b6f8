"""Start a scene and the monitor that watches it.

ros2 launch collision_monitor demo.launch.py scene:=fleet
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    monitor = PathJoinSubstitution([FindPackageShare("collision_monitor"), "launch", "monitor.launch.py"])
    return LaunchDescription(
        [
            DeclareLaunchArgument("scene", default_value="fleet", description="name of the scene to play"),
            IncludeLaunchDescription(monitor),
            Node(
                package="collision_monitor",
                executable="world",
                output="screen",
                parameters=[{"scene": ParameterValue(LaunchConfiguration("scene"), value_type=str)}],
            ),
        ]
    )
