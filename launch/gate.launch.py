"""Start the monitor, and the gate between a planner and the controller of a robot.

ros2 launch collision_monitor gate.launch.py sources:=cell.yaml robot:="arm/*" base:=arm/base urdf:=arm.urdf
ros2 launch collision_monitor gate.launch.py sources:=hall.yaml robot:=cart,load plan_in:=plan plan_out:=checked_plan
ros2 launch collision_monitor gate.launch.py --show-args
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

TEXTS = {
    "robot": "names of the robot's objects in the monitor, separated by commas, with wildcards",
    "base": "name of its base; empty: the first one of `robot`",
    "urdf": "path of the URDF of an arm; empty: a base that follows a path",
    "carrier": "link of an arm that carries objects which are no links",
}
TOPICS = {
    "plan_in": ("plan", "plans to the gate: JointTrajectory of an arm, Path of a base"),
    "plan_out": ("checked_plan", "plans from the gate"),
    "cmd_vel_in": ("cmd_vel_nav", "commands to the gate"),
    "cmd_vel_out": ("cmd_vel", "commands from the gate"),
}


def generate_launch_description() -> LaunchDescription:
    monitor = PathJoinSubstitution([FindPackageShare("collision_monitor"), "launch", "monitor.launch.py"])
    plans = [
        (f"{kind}_{end}", LaunchConfiguration(f"plan_{end}"))
        for kind in ("joint_trajectory", "path")
        for end in ("in", "out")
    ]
    commands = [(name, LaunchConfiguration(name)) for name in ("cmd_vel_in", "cmd_vel_out")]
    return LaunchDescription(
        [
            DeclareLaunchArgument("robot", description=TEXTS["robot"]),
            *(DeclareLaunchArgument(name, default_value="", description=TEXTS[name]) for name in list(TEXTS)[1:]),
            *(
                DeclareLaunchArgument(name, default_value=value, description=text)
                for name, (value, text) in TOPICS.items()
            ),
            IncludeLaunchDescription(monitor),
            Node(
                package="collision_monitor",
                executable="gate",
                output="screen",
                parameters=[{name: ParameterValue(LaunchConfiguration(name), value_type=str) for name in TEXTS}],
                remappings=[*plans, *commands],
            ),
        ]
    )
