"""The executables of the nodes; without ROS 2 they print one line on what is missing."""

import importlib
import os
import signal
import sys
from functools import partial
from importlib.util import find_spec
from pathlib import Path

# As cli/main.py does, before NumPy is loaded: a node multiplies no large matrices.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

# Fast DDS reads its settings from the file that is named here; in Jazzy under its former name.
# Newer ones read it, too, if both are set.
FAST_DDS_FILES = 'FASTDDS_DEFAULT_PROFILES_FILE', 'FASTRTPS_DEFAULT_PROFILES_FILE'
if not any(name in os.environ for name in FAST_DDS_FILES):
    announced_often = str(Path(__file__).with_name('fastdds.xml'))
    os.environ[FAST_DDS_FILES[os.environ.get('ROS_DISTRO') == 'jazzy']] = announced_often


def _run(name: str, place: str, node_class: str) -> int:
    """Load the module of a node, by its place among the nodes, and run it; the exit code."""
    # Libraries may swallow an exception while they are imported, so a signal is only recorded.
    signals: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _: signals.append(number))
    for needed, remedy in (
        ('rclpy', 'source a ROS 2 installation, or use the one that `make build` installs'),
        ('paint_msgs', 'build the workspace with `make build` or colcon and source it'),
    ):
        if find_spec(needed) is None:
            sys.stderr.write(f'{name}: needs {needed}; {remedy}\n')
            return 2
    module = importlib.import_module(f'paint_deposition.nodes.{place}')
    base = importlib.import_module('paint_deposition.nodes.node')
    return base.run_node(getattr(module, node_class), signals)


atomizer_source = partial(_run, 'atomizer_source', 'atomizer_source', 'AtomizerSource')
bag_player = partial(_run, 'bag_player', 'bags.bag_player', 'BagPlayer')
deposition_simulator = partial(
    _run, 'deposition_simulator', 'painting.deposition_simulator', 'DepositionSimulator'
)
egm_source = partial(_run, 'egm_source', 'egm_source', 'EgmSource')
index_planner = partial(_run, 'index_planner', 'index_planner', 'IndexPlanner')
model_comparison = partial(_run, 'model_comparison', 'model_comparison', 'ModelComparison')
opcua_source = partial(_run, 'opcua_source', 'controllers', 'OpcuaSource')
run_recorder = partial(_run, 'run_recorder', 'bags.run_recorder', 'RunRecorder')
rws_source = partial(_run, 'rws_source', 'controllers', 'RwsSource')
web_view = partial(_run, 'web_view', 'web_view', 'WebView')
