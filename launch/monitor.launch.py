"""Start the monitor with the parameters of config/monitor.yaml, and on request the guard of a robot.

ros2 launch collision_monitor monitor.launch.py record:=run.mcap
ros2 launch collision_monitor monitor.launch.py namespace:=hall_2 sources:=hall.yaml rules:=rules.yaml guard:=robot_1
ros2 launch collision_monitor monitor.launch.py --show-args
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, PythonExpression
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

TEXTS = {
    "record": ("", "path of the session to record: a .mcap file or a folder"),
    "sources": ("", "sources file: topics of other programs to monitor"),
    "rules": ("", "rules of the alerts (YAML)"),
}


def generate_launch_description() -> LaunchDescription:
    parameters = PathJoinSubstitution([FindPackageShare("collision_monitor"), "config", "monitor.yaml"])
    use_sim_time = {"use_sim_time": ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool)}
    namespace = LaunchConfiguration("namespace")
    guard = LaunchConfiguration("guard")
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "params", default_value=parameters, description="YAML file of parameters, such as config/fast.yaml"
            ),
            DeclareLaunchArgument("namespace", default_value="", description="namespace of the nodes"),
            DeclareLaunchArgument("use_sim_time", default_value="false", description="take the time from /clock"),
            *(
                DeclareLaunchArgument(name, default_value=value, description=text)
                for name, (value, text) in TEXTS.items()
            ),
            DeclareLaunchArgument(
                "guard", default_value="", description="name of a robot whose commands a guard stops; needs rules"
            ),
            DeclareLaunchArgument("cmd_vel_in", default_value="cmd_vel_nav", description="commands to the guard"),
            DeclareLaunchArgument("cmd_vel_out", default_value="cmd_vel", description="commands from the guard"),
            Node(
                package="collision_monitor",
                executable="monitor",
                name="object_monitor",
                namespace=namespace,
                output="screen",
                parameters=[
                    LaunchConfiguration("params"),
                    {name: ParameterValue(LaunchConfiguration(name), value_type=str) for name in TEXTS},
                    use_sim_time,
                ],
            ),
            Node(
                package="collision_monitor",
                executable="guard",
                namespace=namespace,
                output="screen",
                condition=IfCondition(PythonExpression(["'", guard, "' != ''"])),
                parameters=[
                    {
                        "robot": ParameterValue(guard, value_type=str),
                        "monitor": ParameterValue([namespace, "/object_monitor"], value_type=str),
                    },
                    use_sim_time,
                ],
                remappings=[(name, LaunchConfiguration(name)) for name in ("cmd_vel_in", "cmd_vel_out")],
            ),
        ]
    )
